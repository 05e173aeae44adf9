#include <vector>
void set(int nlevels, std::vector<float> &mvLevelSigma2, std::vector<float> &mvScaleFactor) {
#include "exported/orbslam3_noise.cpp"
}
