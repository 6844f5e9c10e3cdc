#include "particles.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

struct Axis {
  double spacing = 0;
  std::vector<double> position, width, energy_width;
  std::vector<std::uint8_t> fixed;
};

// Weights of the rows in an integral across the axis: midpoint weights, changed at free ends so that
// quadratic functions are integrated exactly between two of them, as the energy of bending asks for (end
// corrections of the midpoint rule: Davis & Rabinowitz 1984, ch. 2.9). Ends at a clamp keep their weights.
void correct_ends(Axis& axis, bool clamped_low, bool clamped_high) {
  const std::size_t n = axis.position.size();
  if (n < 3) return;
  const auto rows = static_cast<double>(n);
  const double share = clamped_low || clamped_high ? 1.0 / 24.0 : rows / (24.0 * (rows - 2));
  const auto correct = [&](std::size_t end, std::size_t next) {
    axis.energy_width[end] += share * axis.spacing;
    axis.energy_width[next] -= share * axis.spacing;
  };
  if (!clamped_low) correct(0, 1);
  if (!clamped_high) correct(n - 1, n - 2);
}

Axis arrange(const Box& box, std::size_t axis, bool clamped_low, bool clamped_high, bool end_corrected) {
  const double length = box.length(axis), from = box.from[axis];
  const bool on_line = box.clamp == Clamp::line;
  // Rows on a clamped line own half a cell only, the free rows share the rest in full cells.
  const double half_cells =
      on_line ? 0.5 * (static_cast<int>(clamped_low) + static_cast<int>(clamped_high)) : 0.0;
  const double free_rows = std::max(1.0, std::round(length / box.spacing - half_cells));
  Axis result;
  result.spacing = length / (free_rows + half_cells);
  const auto add = [&](double position, double width, bool fixed) {
    result.position.push_back(position);
    result.width.push_back(width);
    result.fixed.push_back(fixed ? 1 : 0);
  };
  const double d = result.spacing;
  const double first = from + (clamped_low && on_line ? d : 0.5 * d);
  if (clamped_low) add(on_line ? from : from - 0.5 * d, on_line ? 0.5 * d : d, true);
  for (double i = 0; i < free_rows; ++i) add(first + i * d, d, false);
  if (clamped_high) add(on_line ? box.to[axis] : box.to[axis] + 0.5 * d, on_line ? 0.5 * d : d, true);
  result.energy_width = result.width;
  if (end_corrected && !(axis == 0 && box.periodic)) correct_ends(result, clamped_low, clamped_high);
  return result;
}

Axis arrange(const Box& box, std::size_t axis, bool end_corrected) {
  const Side low = axis == 0 ? Side::left : Side::bottom, high = axis == 0 ? Side::right : Side::top;
  return arrange(box, axis, box.clamped[static_cast<std::size_t>(low)],
                 box.clamped[static_cast<std::size_t>(high)], end_corrected);
}

}  // namespace

double Body::mean_spacing() const {
  return std::sqrt(spacing[0] * spacing[1]);
}

std::array<std::size_t, 2> count_columns(const Box& box) {
  return {arrange(box, 0, false).position.size(), arrange(box, 1, false).position.size()};
}

Body fill(const Box& box, double density, double smoothing_ratio, bool end_corrected) {
  const Axis x = arrange(box, 0, end_corrected), y = arrange(box, 1, end_corrected);
  Body body;
  body.box = box;
  body.columns = {x.position.size(), y.position.size()};
  body.spacing = {x.spacing, y.spacing};
  body.smoothing_length = smoothing_ratio * body.mean_spacing();
  const auto add = [&](std::size_t i, std::size_t j) {
    body.position.insert(body.position.end(), {x.position[i], y.position[j]});
    body.volume.push_back(x.width[i] * y.width[j]);
    body.energy_volume.push_back(x.energy_width[i] * y.energy_width[j]);
    body.mass.push_back(density * body.volume.back());
    body.fixed.push_back(x.fixed[i] | y.fixed[j]);
  };
  // Neighbours then lie close together in memory.
  if (box.length(0) >= box.length(1)) {
    for (std::size_t i = 0; i < x.position.size(); ++i)
      for (std::size_t j = 0; j < y.position.size(); ++j) add(i, j);
  } else {
    for (std::size_t j = 0; j < y.position.size(); ++j)
      for (std::size_t i = 0; i < x.position.size(); ++i) add(i, j);
  }
  return body;
}

State at_rest(const Body& body) {
  State state;
  state.displacement.assign(2 * body.size(), 0.0);
  state.velocity.assign(2 * body.size(), 0.0);
  return state;
}

}  // namespace estuary::solid
