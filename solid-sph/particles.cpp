#include "particles.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

struct Axis {
  double spacing = 0;
  std::vector<double> position, width, energy_width;
  std::vector<std::uint8_t> fixed, edge;
};

// Weights of the rows in an integral across the axis: midpoint weights, changed at free ends so that
// quadratic functions are integrated exactly between two of them, as the energy of bending asks for (end
// corrections of the midpoint rule: Davis & Rabinowitz 1984, ch. 2.9). Rows on a side keep their weights.
void correct_ends(Axis& axis, bool keep_low, bool keep_high) {
  const std::size_t n = axis.position.size();
  if (n < 3) return;
  const auto rows = static_cast<double>(n);
  const double share = keep_low || keep_high ? 1.0 / 24.0 : rows / (24.0 * (rows - 2));
  const auto correct = [&](std::size_t end, std::size_t next) {
    axis.energy_width[end] += share * axis.spacing;
    axis.energy_width[next] -= share * axis.spacing;
  };
  if (!keep_low) correct(0, 1);
  if (!keep_high) correct(n - 1, n - 2);
}

// How one end of an axis is filled.
struct End {
  bool clamped = false;
  bool half_row = false;   // a row of half cells exactly on the side
  bool extra_row = false;  // a fixed row half a spacing outside
};

Axis arrange(const Box& box, std::size_t axis, End low, End high, bool end_corrected) {
  const double length = box.length(axis), from = box.from[axis];
  const bool periodic = axis == 0 && box.periodic;
  const double half_cells = 0.5 * (static_cast<int>(low.half_row) + static_cast<int>(high.half_row));
  // Rows on a side own half a cell only, the others share the rest in full cells.
  double full_rows =
      std::max(low.half_row && high.half_row ? 0.0 : 1.0, std::round(length / box.spacing - half_cells));
  if (box.even && low.half_row && high.half_row && std::fmod(full_rows, 2.0) == 0) full_rows += 1;
  Axis result;
  result.spacing = length / (full_rows + half_cells);
  const auto add = [&](double position, double width, bool fixed, bool edge) {
    result.position.push_back(position);
    result.width.push_back(width);
    result.fixed.push_back(fixed ? 1 : 0);
    result.edge.push_back(edge ? 1 : 0);
  };
  const double d = result.spacing;
  // In a periodic body, too, the contour's nodes then coincide with particles.
  const bool whole = low.half_row || (periodic && box.placement == Placement::on_contour);
  if (low.extra_row) add(from - 0.5 * d, d, true, false);
  if (low.half_row) add(from, 0.5 * d, low.clamped, true);
  const double first = from + (low.half_row ? d : whole ? 0.0 : 0.5 * d);
  for (std::size_t i = 0; i < static_cast<std::size_t>(full_rows); ++i)
    add(first + static_cast<double>(i) * d, d, false, false);
  if (high.half_row) add(box.to[axis], 0.5 * d, high.clamped, true);
  if (high.extra_row) add(box.to[axis] + 0.5 * d, d, true, false);
  result.energy_width = result.width;
  if (end_corrected && !periodic)
    correct_ends(result, low.clamped || low.half_row, high.clamped || high.half_row);
  return result;
}

Axis arrange(const Box& box, std::size_t axis, bool end_corrected) {
  const Side low = axis == 0 ? Side::left : Side::bottom, high = axis == 0 ? Side::right : Side::top;
  const auto end = [&](Side side) {
    const bool clamped = box.clamped[static_cast<std::size_t>(side)];
    const bool periodic = axis == 0 && box.periodic;
    return End{
        .clamped = clamped,
        .half_row = clamped ? box.clamp == Clamp::line : box.placement == Placement::on_contour && !periodic,
        .extra_row = clamped && box.clamp == Clamp::extra_rows};
  };
  return arrange(box, axis, end(low), end(high), end_corrected);
}

}  // namespace

double Body::mean_spacing() const {
  return std::sqrt(spacing[0] * spacing[1]);
}

std::array<std::size_t, 2> count_columns(const Box& box) {
  return {arrange(box, 0, false).position.size(), arrange(box, 1, false).position.size()};
}

std::array<double, 2> actual_spacing(const Box& box) {
  return {arrange(box, 0, false).spacing, arrange(box, 1, false).spacing};
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
    body.fixed.push_back((x.fixed[i] | y.fixed[j]) != 0 ? 3 : 0);
    body.member.push_back(0);
    body.edge.push_back(x.edge[i] | y.edge[j]);
  };
  // Neighbours then lie close together in memory.
  if (box.length(0) >= box.length(1)) {
    for (std::size_t i = 0; i < x.position.size(); ++i)
      for (std::size_t j = 0; j < y.position.size(); ++j) add(i, j);
  } else {
    for (std::size_t j = 0; j < y.position.size(); ++j)
      for (std::size_t i = 0; i < x.position.size(); ++i) add(i, j);
  }
  if (box.placement == Placement::on_contour && box.clamp == Clamp::line && !box.periodic) {
    const std::size_t columns = body.columns[0], rows = body.columns[1];
    const auto number = [&](std::size_t i, std::size_t j) {
      return static_cast<std::uint32_t>(box.length(0) >= box.length(1) ? i * rows + j : j * columns + i);
    };
    Outline outline;
    for (std::size_t j = 0; j + 1 < rows; ++j) outline.particle.push_back(number(0, j));
    for (std::size_t i = 0; i + 1 < columns; ++i) outline.particle.push_back(number(i, rows - 1));
    for (std::size_t j = rows - 1; j > 0; --j) outline.particle.push_back(number(columns - 1, j));
    for (std::size_t i = columns - 1; i > 0; --i) outline.particle.push_back(number(i, 0));
    body.outlines.push_back(std::move(outline));
    body.outline_member.push_back(0);
  }
  return body;
}

void append(Body& body, const Body& next) {
  const auto shift = static_cast<std::uint32_t>(body.size());
  const auto member = static_cast<std::uint8_t>(body.member.empty() ? 0 : body.member.back() + 1);
  const auto join = [](auto& into, const auto& from) { into.insert(into.end(), from.begin(), from.end()); };
  join(body.position, next.position);
  join(body.volume, next.volume);
  join(body.energy_volume, next.energy_volume);
  join(body.mass, next.mass);
  join(body.fixed, next.fixed);
  join(body.edge, next.edge);
  body.member.resize(body.size(), member);
  for (Outline outline : next.outlines) {
    for (std::uint32_t& particle : outline.particle) particle += shift;
    body.outlines.push_back(std::move(outline));
    body.outline_member.push_back(member);
  }
  for (RigidBody rigid : next.rigid) {
    rigid.member = member;
    rigid.first += shift;
    rigid.last += shift;
    body.rigid.push_back(rigid);
  }
}

State at_rest(const Body& body) {
  State state;
  state.displacement.assign(2 * body.size(), 0.0);
  state.velocity.assign(2 * body.size(), 0.0);
  state.rigid.assign(6 * body.rigid.size(), 0.0);
  return state;
}

}  // namespace estuary::solid
