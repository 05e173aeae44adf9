#pragma once
namespace ceres {
struct LossFunction {};
struct CauchyLoss : LossFunction { explicit CauchyLoss(double) {} };
struct HuberLoss : LossFunction { explicit HuberLoss(double) {} };
}  // namespace ceres
