#include "impulses.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

constexpr std::size_t kMostRounds = 60;
constexpr std::size_t kMostIterations = 500;
constexpr double kTolerance = 1e-10;
constexpr double kNothing = 1e-12;

}  // namespace

double ImpulseSolver::relative_velocity(const ContactRow& row, const std::vector<double>& velocity) const {
  double sum = 0;
  for (std::uint32_t k = 0; k < row.count; ++k) sum += row.normal[k] * velocity[row.freedom[k]];
  return sum;
}

void ImpulseSolver::product(const std::vector<ContactRow>& rows, const std::vector<double>& x,
                            std::vector<double>& result) {
  for (std::size_t a = 0; a < active_.size(); ++a) {
    const ContactRow& row = rows[active_[a]];
    for (std::uint32_t k = 0; k < row.count; ++k)
      spread_[row.freedom[k]] += inverse_mass_[row.freedom[k]] * row.normal[k] * x[a];
  }
  for (std::size_t a = 0; a < active_.size(); ++a) result[a] = relative_velocity(rows[active_[a]], spread_);
  for (const std::uint32_t r : active_)
    for (std::uint32_t k = 0; k < rows[r].count; ++k) spread_[rows[r].freedom[k]] = 0;
}

// lambda_ of the active rows, by conjugate gradients from the present values.
std::size_t ImpulseSolver::solve_active(const std::vector<ContactRow>& rows) {
  const std::size_t n = active_.size();
  residual_.resize(n);
  direction_.resize(n);
  image_.resize(n);
  diagonal_.resize(n);
  std::vector<double> x(n);
  double scale = 0;
  for (std::size_t a = 0; a < n; ++a) {
    diagonal_[a] = yielding_[active_[a]];
    x[a] = lambda_[active_[a]];
    scale = std::max(scale, std::abs(wanted_[active_[a]]));
  }
  product(rows, x, image_);
  double gamma = 0;
  for (std::size_t a = 0; a < n; ++a) {
    residual_[a] = wanted_[active_[a]] - image_[a];
    direction_[a] = residual_[a] / diagonal_[a];
    gamma += residual_[a] * direction_[a];
  }
  std::size_t iteration = 0;
  for (; iteration < kMostIterations; ++iteration) {
    double largest = 0;
    for (std::size_t a = 0; a < n; ++a) largest = std::max(largest, std::abs(residual_[a]));
    if (!(largest > kTolerance * scale)) break;
    product(rows, direction_, image_);
    double curvature = 0, size = 0;
    for (std::size_t a = 0; a < n; ++a) {
      curvature += direction_[a] * image_[a];
      size += diagonal_[a] * direction_[a] * direction_[a];
    }
    // What is left is rounding in rows that say the same.
    if (!(curvature > kNothing * size)) break;
    const double step = gamma / curvature;
    double next = 0;
    for (std::size_t a = 0; a < n; ++a) {
      x[a] += step * direction_[a];
      residual_[a] -= step * image_[a];
      next += residual_[a] * residual_[a] / diagonal_[a];
    }
    for (std::size_t a = 0; a < n; ++a)
      direction_[a] = residual_[a] / diagonal_[a] + next / gamma * direction_[a];
    gamma = next;
  }
  for (std::size_t a = 0; a < n; ++a) lambda_[active_[a]] = x[a];
  return iteration;
}

std::size_t ImpulseSolver::solve(std::vector<ContactRow>& rows, double friction,
                                 std::vector<double>& velocity) {
  const std::size_t n = rows.size();
  wanted_.resize(n);
  lambda_.assign(n, 0.0);
  is_active_.assign(n, 0);
  yielding_.resize(n);
  double fastest = 0;
  std::size_t iterations = 0;
  for (std::size_t r = 0; r < n; ++r) {
    wanted_[r] = rows[r].floor - relative_velocity(rows[r], velocity);
    yielding_[r] = 0;
    for (std::uint32_t k = 0; k < rows[r].count; ++k)
      yielding_[r] += inverse_mass_[rows[r].freedom[k]] * rows[r].normal[k] * rows[r].normal[k];
    fastest = std::max(fastest, std::abs(wanted_[r]));
  }
  // Rounding must not make rows come and go.
  const double hair = 1e-9 * fastest;
  // What rests on each other passes a stroke on at once.
  for (std::size_t r = 0; r < n; ++r) is_active_[r] = wanted_[r] >= -hair && yielding_[r] > 0 ? 1 : 0;
  for (std::size_t round = 0; round < kMostRounds; ++round) {
    active_.clear();
    for (std::uint32_t r = 0; r < n; ++r)
      if (is_active_[r] != 0) active_.push_back(r);
    if (active_.empty()) break;
    iterations += solve_active(rows) + 1;
    bool changed = false;
    for (const std::uint32_t r : active_)
      if (lambda_[r] < 0) {
        lambda_[r] = 0;
        is_active_[r] = 0;
        changed = true;
      }
    if (changed) continue;
    // What the impulses do to the other rows.
    for (const std::uint32_t r : active_)
      for (std::uint32_t k = 0; k < rows[r].count; ++k)
        spread_[rows[r].freedom[k]] += inverse_mass_[rows[r].freedom[k]] * rows[r].normal[k] * lambda_[r];
    for (std::size_t r = 0; r < n; ++r)
      if (is_active_[r] == 0 && yielding_[r] > 0 && wanted_[r] - relative_velocity(rows[r], spread_) > hair) {
        is_active_[r] = 1;
        changed = true;
      }
    for (const std::uint32_t r : active_)
      for (std::uint32_t k = 0; k < rows[r].count; ++k) spread_[rows[r].freedom[k]] = 0;
    if (!changed) break;
  }
  for (std::size_t r = 0; r < n; ++r) {
    ContactRow& row = rows[r];
    row.impulse = std::max(0.0, lambda_[r]);
    row.friction = 0;
    for (std::uint32_t k = 0; k < row.count; ++k)
      velocity[row.freedom[k]] += inverse_mass_[row.freedom[k]] * row.normal[k] * row.impulse;
  }
  if (!(friction > 0)) return iterations;
  // A few sweeps of Gauss-Seidel: every row sticks, or slides with the largest friction it may have.
  for (int sweep = 0; sweep < 10; ++sweep)
    for (ContactRow& row : rows) {
      if (!(row.impulse > 0)) continue;
      double slip = 0, yield = 0;
      for (std::uint32_t k = 0; k < row.count; ++k) {
        slip += row.tangent[k] * velocity[row.freedom[k]];
        yield += row.tangent[k] * row.tangent[k] * inverse_mass_[row.freedom[k]];
      }
      if (!(yield > 0)) continue;
      const double most = friction * row.impulse;
      const double next = std::clamp(row.friction - slip / yield, -most, most);
      for (std::uint32_t k = 0; k < row.count; ++k)
        velocity[row.freedom[k]] += inverse_mass_[row.freedom[k]] * row.tangent[k] * (next - row.friction);
      row.friction = next;
    }
  return iterations;
}

}  // namespace estuary::solid
