#include <vector>
void set(int nlevels, float scaleFactor, std::vector<float> &mvLevelSigma2, std::vector<float> &mvScaleFactor) {
  mvScaleFactor.assign(nlevels, 1.0f);
  mvLevelSigma2.assign(nlevels, 1.0f);
  for (int level = 1; level < nlevels; ++level) mvScaleFactor[level] = scaleFactor * mvScaleFactor[level - 1];
#include "exported/orbslam3_noise.cpp"
}
#include <cstdio>
int main() {
  std::vector<float> squares, scales;
  set(3, 2.0f, squares, scales);
  for (float square : squares) std::printf("%.9g ", square);
}
