float information() {
#include "exported/cuvslam_sigma.cpp"
  return 1.f / (stdPx * stdPx);
}
void set(float *info_mat) {
#include "exported/cuvslam_kernels.cpp"
}
float scale() {
#include "exported/cuvslam_bundle.cpp"
  return robustifier_scale * (3.0f / visual_noise_px);
}
