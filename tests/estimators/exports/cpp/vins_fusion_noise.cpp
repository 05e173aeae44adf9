#include <Eigen/Dense>
#include "ceres.hpp"
using Eigen::Matrix2d;
struct ProjectionTwoFrameOneCamFactor { static Matrix2d sqrt_info; };
struct ProjectionTwoFrameTwoCamFactor { static Matrix2d sqrt_info; };
struct ProjectionOneFrameTwoCamFactor { static Matrix2d sqrt_info; };
void set(ceres::LossFunction *loss_function) {
#include "exported/vins_fusion_noise.cpp"
}
