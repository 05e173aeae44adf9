#include <map>
#include <memory>
#include <vector>
#include "exported/openvins_track_covariance.hpp"
struct Pose {
  Eigen::Matrix3d Rot() const;
  Eigen::Vector3d pos() const;
};
struct State {
  std::map<double, std::shared_ptr<Pose>> _clones_IMU;
  std::map<int, std::shared_ptr<Pose>> _calib_IMUtoCAM;
};
struct Feature {
  Eigen::Vector3d p_FinG;
  std::map<int, std::vector<double>> timestamps;
};
void update(std::shared_ptr<State> state, std::vector<std::shared_ptr<Feature>>::iterator it2, Feature feat,
            Eigen::MatrixXd H_f, Eigen::MatrixXd H_x, Eigen::VectorXd res) {
#include "exported/openvins.patch"
}
