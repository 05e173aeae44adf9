#include <Eigen/Dense>
namespace gtsam {
using Matrix2 = Eigen::Matrix2d;
namespace noiseModel {
namespace mEstimator {
struct Cauchy { static Cauchy Create(double); };
}
struct Gaussian { static Gaussian Covariance(const Matrix2 &); };
struct Robust { static Robust Create(const mEstimator::Cauchy &, const Gaussian &); };
struct Isotropic { static Isotropic Sigma(int, double); };
}  // namespace noiseModel
}  // namespace gtsam
void set() {
#include "exported/gtsam_noise.cpp"
}
