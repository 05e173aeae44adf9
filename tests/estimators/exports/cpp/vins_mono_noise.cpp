#include <Eigen/Dense>
#include "ceres.hpp"
using Eigen::Matrix2d;
struct ProjectionFactor { static Matrix2d sqrt_info; };
struct ProjectionTdFactor { static Matrix2d sqrt_info; };
void set(ceres::LossFunction *loss_function) {
#include "exported/vins_mono_noise.cpp"
}
