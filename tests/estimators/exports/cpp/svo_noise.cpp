#include <Eigen/Dense>
void set(Eigen::Matrix2d information, int level) {
#include "exported/svo_noise.cpp"
}
