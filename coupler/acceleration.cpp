#include "acceleration.hpp"

#include <algorithm>
#include <cmath>

#include "quasi_newton.hpp"

namespace estuary::coupler {

void relax(double factor, std::span<const double> residual, std::span<double> iterate) {
  for (std::size_t i = 0; i < iterate.size(); ++i) iterate[i] += factor * residual[i];
}

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

void AitkenRelaxation::forget() {
  last_residual_.clear();
  omega_ = initial_;
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

std::unique_ptr<Acceleration> make_acceleration(const AccelerationSettings& settings) {
  const QuasiNewtonSettings quasi_newton{.relaxation = settings.relaxation,
                                         .windows_reused = settings.windows_reused,
                                         .most_columns = settings.most_columns,
                                         .filter = settings.filter,
                                         .filter_limit = settings.filter_limit,
                                         .remainder = settings.remainder,
                                         .fields = settings.fields};
  switch (settings.kind) {
    case AccelerationKind::none:
      return std::make_unique<ConstantRelaxation>(1.0);
    case AccelerationKind::constant:
      return std::make_unique<ConstantRelaxation>(settings.relaxation);
    case AccelerationKind::iqn_ils:
      return std::make_unique<InterfaceQuasiNewton>(quasi_newton);
    case AccelerationKind::iqn_imvj:
      return std::make_unique<MultiVectorQuasiNewton>(quasi_newton);
    case AccelerationKind::aitken:
      break;
  }
  return std::make_unique<AitkenRelaxation>(settings.relaxation);
}

}  // namespace estuary::coupler
