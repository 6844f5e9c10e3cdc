#include "reproducing_weights.hpp"

#include <cmath>
#include <stdexcept>

#include "least_norm.hpp"

namespace estuary::solid {
namespace {

// Singular values below this share of the moments count as "the points cannot tell".
constexpr double kResolved = 1e-3;
// Below this share of the largest, the points do not span what must be exact.
constexpr double kSpanned = 1e-9;

// One row of moments: a function of the offsets.
template <class Function>
std::vector<double> moment(std::span<const Offset> offsets, Function&& function) {
  std::vector<double> row;
  row.reserve(offsets.size());
  for (const Offset& offset : offsets) row.push_back(function(offset));
  return row;
}

Rows quadratic_moments(std::span<const Offset> offsets) {
  return {moment(offsets, [](const Offset& o) { return o.x * o.x; }),
          moment(offsets, [](const Offset& o) { return o.x * o.y; }),
          moment(offsets, [](const Offset& o) { return o.y * o.y; })};
}

// Least-norm solution in the unknowns a_j / sqrt(w_j): `exact` a = target holds, `desired` a = 0 as far as
// possible; one result per target.
struct Solution {
  Rows weights;
  bool complete = true;
};

Solution solve(Rows exact, const Rows& targets, Rows desired, std::span<const double> weights) {
  std::vector<double> scale;
  for (const double w : weights) scale.push_back(std::sqrt(w));
  const auto in_scaled_unknowns = [&](Rows& rows) {
    for (auto& row : rows)
      for (std::size_t j = 0; j < row.size(); ++j) row[j] *= scale[j];
  };
  in_scaled_unknowns(exact);
  in_scaled_unknowns(desired);
  const std::size_t points = scale.size(), conditions = exact.size();
  const LeastNorm held(std::move(exact));
  if (points < conditions || held.rank(kSpanned * held.largest()) < conditions)
    throw std::domain_error("neighbouring particles do not span the plane");
  Solution solution;
  for (const auto& target : targets) solution.weights.push_back(held.solve(target, 0));
  if (!desired.empty()) {
    // Compared with the moments themselves, not with each other: one that vanishes where `exact` leaves
    // freedom is not resolved.
    double size = 0;
    for (const auto& row : desired) size += dot(row, row);
    const double smallest = kResolved * std::sqrt(size);
    Rows rest = desired;
    for (auto& row : rest) held.project_out(row);
    const LeastNorm free(std::move(rest));
    for (auto& y : solution.weights) {
      std::vector<double> gap;
      for (const auto& row : desired) gap.push_back(-dot(row, y));
      const std::vector<double> change = free.solve(gap, smallest);
      for (std::size_t j = 0; j < points; ++j) y[j] += change[j];
    }
    solution.complete = points > conditions && free.rank(smallest) == desired.size();
  }
  for (auto& y : solution.weights)
    for (std::size_t j = 0; j < points; ++j) y[j] *= scale[j];
  return solution;
}

}  // namespace

std::vector<double> value_weights(std::span<const Offset> offsets, std::span<const double> weights,
                                  Curvature curvature, Offset tangent) {
  Rows desired;
  if (curvature == Curvature::all) desired = quadratic_moments(offsets);
  if (curvature == Curvature::tangential)
    desired.push_back(
        moment(offsets, [&](const Offset& o) { return std::pow(o.x * tangent.x + o.y * tangent.y, 2); }));
  return solve({moment(offsets, [](const Offset&) { return 1.0; }),
                moment(offsets, [](const Offset& o) { return o.x; }),
                moment(offsets, [](const Offset& o) { return o.y; })},
               {{1, 0, 0}}, std::move(desired), weights)
      .weights.front();
}

std::vector<double> value_weights_on_line(std::span<const Offset> offsets, std::span<const double> weights,
                                          Offset tangent) {
  return solve({moment(offsets, [](const Offset&) { return 1.0; }),
                moment(offsets, [&](const Offset& o) { return o.x * tangent.x + o.y * tangent.y; })},
               {{1, 0}}, {}, weights)
      .weights.front();
}

GradientWeights gradient_weights(std::span<const Offset> offsets, std::span<const double> weights,
                                 Order order, bool between) {
  Rows exact{moment(offsets, [](const Offset& o) { return o.x; }),
             moment(offsets, [](const Offset& o) { return o.y; })};
  Rows targets{{1, 0}, {0, 1}};
  if (between) {
    exact.push_back(moment(offsets, [](const Offset&) { return 1.0; }));
    for (auto& target : targets) target.push_back(0);
  }
  const Solution solution =
      solve(std::move(exact), targets, order == Order::linear ? Rows{} : quadratic_moments(offsets), weights);
  GradientWeights result;
  result.complete = solution.complete;
  for (std::size_t j = 0; j < offsets.size(); ++j)
    result.weights.push_back({solution.weights[0][j], solution.weights[1][j]});
  return result;
}

}  // namespace estuary::solid
