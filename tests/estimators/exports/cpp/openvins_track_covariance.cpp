#include <cstdio>
#include "exported/openvins_track_covariance.hpp"
int main() {
  Eigen::MatrixXd covariance = tracknoise::track_covariance({4.0, 3.0, 2.5});
  for (int row = 0; row < 6; ++row)
    for (int column = 0; column < 6; ++column) std::printf("%.9g\n", covariance(row, column));
}
