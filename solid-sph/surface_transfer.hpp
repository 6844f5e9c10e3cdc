// Between the true contour of the body and its particles.
//
// A contour node moves with sum_j w_j u_j. Where particles lie on the contour the node is one of them, and
// along a straight side a five-point filter (Shapiro 1970) keeps sawtooth motion from the other side: it
// neither sees nor loads it. Where they lie half a spacing inside, the weights reproduce linear displacement
// fields exactly and quadratic ones as far as the nearby particles allow (moving least squares). Forces on
// nodes go to particles with the transposed weights: total force, moment in the current configuration and
// work are then the same on both sides.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "neighbourhood.hpp"

namespace estuary::solid {

/// An ordered line of nodes on a contour, walked clockwise round the body: the outside is on the left of each
/// segment.
struct ContourLine {
  std::vector<double> position;    // [m], 2 per node
  std::vector<std::uint8_t> held;  // 1 + index of the clamped side a node lies on, 0 when it lies on none
  bool closed = false;

  [[nodiscard]] std::size_t size() const { return position.size() / 2; }
  [[nodiscard]] std::size_t segments() const { return closed ? size() : size() - 1; }
};

/// The line along the sides wished for, nodes about one particle spacing apart, corners included. Throws
/// std::invalid_argument when the sides do not follow one another round the box.
ContourLine contour_line(const Body& body, std::span<const Side> sides);
/// Every outline of a body with particles on its contours, without the stretches held in both components.
std::vector<ContourLine> free_contours(const Body& body);

/// Weights of particles for a list of points, as compressed rows.
struct Transfer {
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> touched;   // particles that occur, ascending
  std::vector<std::uint32_t> position;  // index into `touched`, one per entry
  std::vector<double> weight;

  [[nodiscard]] std::size_t points() const { return first.size() - 1; }
};

/// Throws std::domain_error naming the point when the particles near it do not allow a linear fit.
Transfer contour_transfer(const Body& body, std::span<const ContourLine> lines);
inline Transfer contour_transfer(const Body& body, const ContourLine& line) {
  return contour_transfer(body, {&line, 1});
}
/// For any points of the box, 2 numbers each.
Transfer point_transfer(const Body& body, std::span<const double> points);

/// Values at the points from values at the particles, 2 components each.
void interpolate(const Transfer& transfer, std::span<const double> particle_values,
                 std::span<double> point_values);
/// Forces on `transfer.touched` from forces at the points: the transposed operation.
void spread(const Transfer& transfer, std::span<const double> point_forces,
            std::vector<double>& touched_forces);

/// Consistent nodal forces of a traction constant along the line with the given resultant.
std::vector<double> uniform_traction(const ContourLine& line, double force_x, double force_y);

}  // namespace estuary::solid
