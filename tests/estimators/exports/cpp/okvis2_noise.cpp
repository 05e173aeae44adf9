#include <Eigen/Dense>
void set(Eigen::Matrix2d information) {
#include "exported/okvis2_noise.cpp"
}
