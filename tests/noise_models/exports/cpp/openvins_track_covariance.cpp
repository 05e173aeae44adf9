#include <cstdio>
#include "exported/openvins_track_covariance.hpp"
int main() {
  Eigen::MatrixXd covariance = tracknoise::track_covariance({4.0, 3.0, 2.5});
  for (const double value : covariance.entry) std::printf("%.9g\n", value);
}
