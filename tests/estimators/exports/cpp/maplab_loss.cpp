#include "ceres.hpp"
ceres::LossFunction *loss =
#include "exported/maplab_loss.cpp"
;
