#include "driven_surface.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "wet_surface.hpp"
#include "window_interpolation.hpp"

namespace estuary::solid {
namespace {

constexpr std::uint32_t kNone = 0xffffffffU;

// The lines of a surface, walked with the wet side on the left.
std::vector<Outline> lines_of(const v1::WetSurface& surface, std::size_t nodes) {
  std::vector<std::uint32_t> after(nodes, kNone), before(nodes, kNone);
  for (int f = 0; f + 1 < surface.connectivity_size(); f += 2) {
    const std::uint32_t a = surface.connectivity(f), b = surface.connectivity(f + 1);
    if (after[a] != kNone || before[b] != kNone)
      throw std::invalid_argument(
          "more than two of its segments meet in a node, or two run against each "
          "other; bodies that meet it need lines, at node " +
          std::to_string(after[a] != kNone ? a : b));
    after[a] = b;
    before[b] = a;
  }
  std::vector<std::uint8_t> walked(nodes, 0);
  std::vector<Outline> lines;
  // Open lines from their ends, then what is left: loops.
  for (const bool loops : {false, true})
    for (std::uint32_t i = 0; i < nodes; ++i) {
      if (walked[i] != 0 || after[i] == kNone || (!loops && before[i] != kNone)) continue;
      Outline line;
      line.closed = loops;
      for (std::uint32_t k = i; k != kNone && walked[k] == 0; k = after[k]) {
        walked[k] = 1;
        line.particle.push_back(k);
      }
      lines.push_back(std::move(line));
    }
  return lines;
}

}  // namespace

double SurfaceMotion::at(std::size_t c, double now) const {
  const double s = std::max((now - time) / duration, 0.0);
  // The step that begins at the window's end goes on as it ended.
  if (s > 1) return end[c] + end_velocity[c] * (now - time - duration);
  return hermite(start[c], start_velocity[c], end[c], end_velocity[c], duration, s);
}

DrivenSurface::DrivenSurface(const v1::WetSurface& surface, Body& body)
    : surface_(surface), first_(static_cast<std::uint32_t>(body.size())) {
  check_wet_surface(surface);
  if (surface.dimension() != 2) throw std::invalid_argument("it is not in two dimensions");
  const std::size_t nodes = node_count(surface);
  Body contour;
  contour.position.assign(surface.reference_positions().begin(), surface.reference_positions().end());
  contour.volume.assign(nodes, 0.0);
  contour.energy_volume = contour.mass = contour.volume;
  contour.fixed.assign(nodes, 7);
  contour.edge.assign(nodes, 1);
  contour.outlines = lines_of(surface, nodes);
  append(body, contour);
}

void DrivenSurface::place(const v1::Displacements& motion, State& state) const {
  check_displacements(motion, surface_);
  std::copy(motion.displacement().begin(), motion.displacement().end(),
            state.displacement.begin() + 2 * static_cast<std::ptrdiff_t>(first_));
  std::copy(motion.velocity().begin(), motion.velocity().end(),
            state.velocity.begin() + 2 * static_cast<std::ptrdiff_t>(first_));
}

SurfaceMotion DrivenSurface::window(const State& start, const v1::Displacements& motion, double time,
                                    double duration) const {
  check_displacements(motion, surface_);
  const auto own = [&](const std::vector<double>& all) {
    return std::vector<double>(all.begin() + 2 * static_cast<std::ptrdiff_t>(first_), all.end());
  };
  std::vector<std::array<std::uint32_t, 2>> torn;
  for (const std::uint32_t facet : motion.torn()) {
    const auto at = static_cast<int>(2 * facet);
    torn.push_back({first_ + surface_.connectivity(at), first_ + surface_.connectivity(at + 1)});
  }
  return {.first = first_,
          .start = own(start.displacement),
          .start_velocity = own(start.velocity),
          .end = {motion.displacement().begin(), motion.displacement().end()},
          .end_velocity = {motion.velocity().begin(), motion.velocity().end()},
          .time = time,
          .duration = duration,
          .torn = std::move(torn)};
}

DrivenSurface::Load DrivenSurface::load(std::span<const double> impulse, double duration,
                                        const State& end) const {
  Load load;
  load.forces.set_surface(surface_.identity());
  const std::size_t nodes = node_count(surface_);
  for (std::size_t k = 0; k < nodes; ++k) {
    std::array<double, 2> force{}, place{};
    for (std::size_t c = 0; c < 2; ++c) {
      force[c] = impulse.empty() ? 0.0 : impulse[2 * k + c] / duration;
      place[c] =
          surface_.reference_positions(static_cast<int>(2 * k + c)) + end.displacement[2 * (first_ + k) + c];
      load.forces.add_force(force[c]);
      load.sum[c] += force[c];
    }
    load.moment += place[0] * force[1] - place[1] * force[0];
  }
  return load;
}

}  // namespace estuary::solid
