struct Settings {
  double keypoint_uncertainty_px;
  Settings() :
#include "exported/maplab_sigma.cpp"
  {}
};
