#include <Eigen/Dense>
struct Estimator { void setObservationInformation(int, int, int, const Eigen::Matrix2d &); };
void set(Estimator estimator, int stateId, int cam, int keypoint) {
#include "exported/okvis2_observation.cpp"
}
