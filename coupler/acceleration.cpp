#include "acceleration.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "coupling_scene.hpp"

namespace estuary::coupler {
namespace {

void relax(double omega, std::span<const double> residual, std::span<double> iterate) {
  for (std::size_t i = 0; i < iterate.size(); ++i) iterate[i] += omega * residual[i];
}

}  // namespace

void ConstantRelaxation::update(std::span<const double> residual, std::span<double> iterate) {
  relax(omega_, residual, iterate);
}

AitkenRelaxation::AitkenRelaxation(double initial, double largest)
    : initial_(initial), largest_(largest), omega_(initial) {}

void AitkenRelaxation::begin_window() {
  last_residual_.clear();
  omega_ = std::copysign(std::min(std::abs(omega_), initial_), omega_);
  if (omega_ == 0.0) omega_ = initial_;
}

void AitkenRelaxation::update(std::span<const double> residual, std::span<double> iterate) {
  if (!last_residual_.empty()) {
    double product = 0;
    double square = 0;
    for (std::size_t i = 0; i < residual.size(); ++i) {
      const double change = residual[i] - last_residual_[i];
      product += last_residual_[i] * change;
      square += change * change;
    }
    const double next = -omega_ * product / square;  // 0/0 for a repeated residual is not finite
    if (std::isfinite(next) && next != 0.0) omega_ = std::clamp(next, -largest_, largest_);
  }
  last_residual_.assign(residual.begin(), residual.end());
  relax(omega_, residual, iterate);
}

InterfaceQuasiNewton::InterfaceQuasiNewton(double initial, std::size_t windows_reused,
                                           std::size_t most_columns, double filter_limit)
    : initial_(initial),
      factor_(initial),
      windows_reused_(windows_reused),
      most_columns_(most_columns),
      filter_limit_(filter_limit),
      columns_of_window_{0} {}

void InterfaceQuasiNewton::begin_window() {
  last_residual_.clear();
  last_answer_.clear();
  if (columns_of_window_.front() > 0) columns_of_window_.push_front(0);
  while (columns_of_window_.size() > windows_reused_ + 1) {
    residual_changes_.resize(residual_changes_.size() - columns_of_window_.back());
    answer_changes_.resize(residual_changes_.size());
    columns_of_window_.pop_back();
  }
}

void InterfaceQuasiNewton::update(std::span<const double> residual, std::span<double> iterate) {
  const auto size = static_cast<Eigen::Index>(iterate.size());
  std::vector<double> answer(iterate.begin(), iterate.end());
  for (std::size_t i = 0; i < answer.size(); ++i) answer[i] += residual[i];
  if (!last_residual_.empty()) {
    std::vector<double> residual_change(answer.size());
    std::vector<double> answer_change(answer.size());
    for (std::size_t i = 0; i < answer.size(); ++i) {
      residual_change[i] = residual[i] - last_residual_[i];
      answer_change[i] = answer[i] - last_answer_[i];
    }
    residual_changes_.push_front(std::move(residual_change));
    answer_changes_.push_front(std::move(answer_change));
    ++columns_of_window_.front();
  }
  last_residual_.assign(residual.begin(), residual.end());
  last_answer_ = answer;

  // Modified Gram-Schmidt over the columns, newest first: what is left of a column decides whether it stays.
  constexpr double round_off = 1e-11;
  const double smallest = round_off * Eigen::Map<const Eigen::VectorXd>(answer.data(), size).norm();
  std::vector<Eigen::VectorXd> basis;
  std::vector<std::size_t> used;
  Eigen::MatrixXd triangle = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(residual_changes_.size()),
                                                   static_cast<Eigen::Index>(residual_changes_.size()));
  for (std::size_t column = 0; column < residual_changes_.size(); ++column) {
    if (basis.size() == most_columns_ || static_cast<Eigen::Index>(basis.size()) == size) break;
    Eigen::VectorXd rest = Eigen::Map<const Eigen::VectorXd>(residual_changes_[column].data(), size);
    const double norm = rest.norm();
    if (!(norm > smallest)) continue;
    const auto next = static_cast<Eigen::Index>(basis.size());
    Eigen::VectorXd products = Eigen::VectorXd::Zero(next);
    // Twice is enough to be orthogonal to round-off.
    for (int pass = 0; pass < 2; ++pass) {
      for (Eigen::Index k = 0; k < next; ++k) {
        const double product = basis[static_cast<std::size_t>(k)].dot(rest);
        products[k] += product;
        rest -= product * basis[static_cast<std::size_t>(k)];
      }
    }
    if (!(rest.norm() > filter_limit_ * norm)) continue;
    triangle.col(next).head(next) = products;
    triangle(next, next) = rest.norm();
    basis.push_back(rest / rest.norm());
    used.push_back(column);
  }
  if (basis.empty()) {
    factor_ = initial_;
    relax(factor_, residual, iterate);
    return;
  }
  factor_ = 1;
  const auto count = static_cast<Eigen::Index>(basis.size());
  const Eigen::Map<const Eigen::VectorXd> right(residual.data(), size);
  Eigen::VectorXd projected(count);
  for (Eigen::Index k = 0; k < count; ++k) projected[k] = -basis[static_cast<std::size_t>(k)].dot(right);
  const Eigen::VectorXd coefficients =
      triangle.topLeftCorner(count, count).triangularView<Eigen::Upper>().solve(projected);
  std::copy(answer.begin(), answer.end(), iterate.begin());
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto& change = answer_changes_[used[static_cast<std::size_t>(k)]];
    for (std::size_t i = 0; i < iterate.size(); ++i) iterate[i] += coefficients[k] * change[i];
  }
}

std::unique_ptr<Acceleration> make_acceleration(const AccelerationSettings& settings) {
  switch (settings.kind) {
    case AccelerationKind::none:
      return std::make_unique<ConstantRelaxation>(1.0);
    case AccelerationKind::constant:
      return std::make_unique<ConstantRelaxation>(settings.relaxation);
    case AccelerationKind::iqn_ils:
      return std::make_unique<InterfaceQuasiNewton>(settings.relaxation, settings.windows_reused);
    case AccelerationKind::aitken:
      break;
  }
  return std::make_unique<AitkenRelaxation>(settings.relaxation);
}

}  // namespace estuary::coupler
