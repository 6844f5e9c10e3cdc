// Contact between bodies: frictionless, by a penalty between their contours.
//
// Every segment of a contour carries two Gauss points. One that lies inside another body is pushed towards
// the nearest point of that body's contour by a pressure in proportion to its depth g, and the contour there
// is pushed back: the energy is sum 1/2 k w g^2 over the Gauss points of both sides (w the reference length
// of each, half the stiffness k to each side). Forces are its exact derivative (node-to-segment
// linearisation: Wriggers, Computational Contact Mechanics, 2006, ch. 9; Gauss points on the segments:
// Fischer & Wriggers 2005, without their mortar projection), so that momentum and angular momentum are
// conserved to round-off and energy as well as by the rest of the method.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "particles.hpp"

namespace estuary::solid {

struct ContactSettings {
  /// Of each body: pressure per depth in spacings [Pa]. Two bodies meet with the smaller one; 0 (a rigid
  /// body) leaves it to the other.
  std::vector<double> modulus;
  /// Of two bodies that both have none [Pa].
  double rigid_modulus = 0;
};

/// A point of a contour went deeper into another body than contact can follow.
struct ContactLost : std::runtime_error {
  ContactLost(std::size_t which, double how_deep)
      : std::runtime_error("too deep inside another body"), particle(which), depth(how_deep) {}
  std::size_t particle;
  double depth;  // in spacings
};

class Contact {
public:
  Contact(const Body& body, const ContactSettings& settings);

  /// Contours without these pieces, each given by its two particles in their order: there a body is torn, and
  /// what comes passes through.
  void tear(std::span<const std::array<std::uint32_t, 2>> pieces);
  /// Adds the contact forces of a state to `force` [N/m]. Throws ContactLost.
  void add_to(std::span<const double> displacement, std::vector<double>& force);

  // Of the last call.
  [[nodiscard]] bool touching() const { return touching_; }
  [[nodiscard]] double energy() const { return energy_; }  // [J/m]
  /// Contact force on each body, x and y [N/m].
  [[nodiscard]] const std::vector<double>& body_force() const { return body_force_; }

  /// Bound of the squared frequency that contact adds [1/s2].
  [[nodiscard]] double squared_frequency() const { return squared_frequency_; }

private:
  struct Segment {
    std::uint32_t a, b;           // particles; the outside is on the left
    std::uint32_t before, after;  // segments of the same contour
    std::uint8_t member;
    double length;  // reference [m]
    bool torn;
  };
  struct Box {
    double low[2], high[2];
  };
  // The point of a contour nearest to a point inside.
  struct Foot {
    std::uint32_t a, b;
    double share;      // of b
    double normal[2];  // outward
    double depth;
  };

  [[nodiscard]] double stiffness(std::size_t member, std::size_t other) const;
  bool find_region();
  void sort_into_cells();
  bool nearest(double x, double y, const double* own_normal, std::size_t member, Foot& foot) const;
  void consider(std::uint32_t segment, double x, double y, const double* own_normal, double& best, Foot& foot,
                bool& inside) const;
  [[nodiscard]] const double* at(std::uint32_t particle) const { return &position_[2 * place_[particle]]; }

  const Body& body_;
  ContactSettings settings_;
  double spacing_;
  std::vector<Segment> segments_;
  std::vector<std::uint32_t> place_;  // of a contour's particle in position_
  std::vector<std::uint32_t> particle_;
  std::vector<double> position_;
  std::vector<Box> boxes_;  // of each body
  Box region_{};            // where contact is possible
  double longest_ = 0;      // segment
  double cell_ = 0;
  std::size_t columns_ = 0, rows_ = 0;
  std::vector<std::uint32_t> near_;  // segments in the region
  std::vector<std::uint32_t> cell_first_, cell_segment_, cell_of_;
  std::vector<double> body_force_;
  double energy_ = 0, squared_frequency_ = 0;
  bool touching_ = false;
};

}  // namespace estuary::solid
