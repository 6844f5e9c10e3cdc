// Particles of a shell along its polyline, and where a point lies among them.
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "shell_row.hpp"

namespace estuary::solid {

Body fill_row(std::span<const std::array<double, 2>> points, bool closed, double spacing,
              const ShellSection& section) {
  Body body;
  double total = 0;
  std::size_t links = 0;
  const std::size_t pieces = closed ? points.size() : points.size() - 1;
  for (std::size_t p = 0; p < pieces; ++p) {
    const std::array<double, 2>&from = points[p], &to = points[(p + 1) % points.size()];
    const double length = std::hypot(to[0] - from[0], to[1] - from[1]);
    if (!(length > 1e-3 * spacing)) throw std::invalid_argument("two points of its polyline coincide");
    const auto parts = static_cast<std::size_t>(std::max(1.0, std::round(length / spacing)));
    for (std::size_t k = 0; k < parts; ++k) {
      const double share = static_cast<double>(k) / static_cast<double>(parts);
      body.position.insert(body.position.end(),
                           {from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])});
    }
    total += length;
    links += parts;
  }
  if (!closed) body.position.insert(body.position.end(), {points.back()[0], points.back()[1]});
  const std::size_t n = body.position.size() / 2;
  body.spacing = {total / static_cast<double>(links), total / static_cast<double>(links)};
  body.smoothing_length = body.spacing[0];
  body.volume.assign(n, 0.0);
  Outline outline;
  outline.closed = closed;
  for (std::size_t i = 0; i < n; ++i) outline.particle.push_back(static_cast<std::uint32_t>(i));
  for (std::size_t i = 0; i < (closed ? n : n - 1); ++i) {
    const std::size_t j = i + 1 < n ? i + 1 : 0;
    const double length = std::hypot(body.position[2 * j] - body.position[2 * i],
                                     body.position[2 * j + 1] - body.position[2 * i + 1]);
    for (const std::size_t end : {i, j}) body.volume[end] += 0.5 * length * section.thickness;
  }
  body.energy_volume = body.volume;
  for (const double v : body.volume) body.mass.push_back(section.density * v);
  body.fixed.assign(n, 0);
  body.edge.assign(n, 1);
  body.member.assign(n, 0);
  body.outlines.push_back(std::move(outline));
  body.outline_member.push_back(0);
  return body;
}

Transfer row_transfer(const Body& body, const std::array<double, 2>& place) {
  double best = std::numeric_limits<double>::infinity(), share = 0;
  std::array<std::uint32_t, 2> ends{};
  for (const Outline& outline : body.outlines) {
    const std::size_t n = outline.particle.size();
    for (std::size_t k = 0; k < (outline.closed ? n : n - 1); ++k) {
      const std::uint32_t a = outline.particle[k], b = outline.particle[(k + 1) % n];
      const std::array<double, 2> from{body.position[2 * a], body.position[2 * a + 1]},
          along{body.position[2 * b] - from[0], body.position[2 * b + 1] - from[1]},
          to{place[0] - from[0], place[1] - from[1]};
      const double s = std::clamp(
          (to[0] * along[0] + to[1] * along[1]) / (along[0] * along[0] + along[1] * along[1]), 0.0, 1.0);
      const double distance = std::hypot(to[0] - s * along[0], to[1] - s * along[1]);
      if (!(distance < best)) continue;
      best = distance;
      share = s;
      ends = {a, b};
    }
  }
  Transfer transfer;
  transfer.first = {0, 2};
  transfer.position = {0, 1};
  transfer.touched = {ends[0], ends[1]};
  transfer.weight = {1 - share, share};
  return transfer;
}

}  // namespace estuary::solid
