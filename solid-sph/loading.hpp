// What acts on a body from outside: loads on particles, tractions, pressures that follow the surface,
// prescribed motion.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "contact.hpp"
#include "driven_surface.hpp"
#include "particles.hpp"

namespace estuary::solid {

/// Forces on some particles, scaled by a factor of time: at the share s of a window they are
/// start + s (end - start) + s (s - 1) bend.
struct ParticleLoad {
  std::vector<std::uint32_t> particle;
  std::vector<double> start, end;        // [N/m], 2 per listed particle
  std::vector<double> bend;              // the same; empty when they change linearly
  std::function<double(double)> factor;  // of the time [s]; empty means 1
  [[nodiscard]] double at(std::size_t c, double s) const {
    const double linear = start[c] + s * (end[c] - start[c]);
    return bend.empty() ? linear : linear + s * (s - 1) * bend[c];
  }
};

/// Force per reference length of a contour, constant in direction when the contour turns.
struct TractionLoad {
  std::vector<std::array<std::uint32_t, 2>> segment;  // integrated by two Gauss points each
  std::function<std::array<double, 2>(double, double, double)> traction;  // of reference x, y and t [Pa]
};

/// Pressure on the current contour, along its current normal.
struct PressureLoad {
  std::vector<std::array<std::uint32_t, 2>> segment;       // the outside on the left of each
  std::function<double(double, double, double)> pressure;  // of reference x, y and t [Pa]
};

/// Displacement of one component of some particles; the body must hold that component (Body::fixed).
struct PrescribedMotion {
  std::vector<std::uint32_t> particle;
  std::size_t component = 0;
  std::function<double(double, double, double)> displacement;  // of reference x, y and t [m]
};

/// Moment on particles of a shell, in equal shares.
struct MomentLoad {
  std::vector<std::uint32_t> particle;
  double moment = 0;                     // [N m/m]
  std::function<double(double)> factor;  // of the time [s]; empty means 1
};

/// Displacement of one degree of freedom (x, y, rotation) of a rigid body that holds it.
struct RigidDrive {
  std::size_t rigid = 0, freedom = 0;          // index into Body::rigid
  std::function<double(double)> displacement;  // of the time [m], [rad]
};

struct Loading {
  std::vector<ParticleLoad> loads;
  // On fibres of shells: force times its distance from the mid-line along the fibre [N], so that the moment
  // is n x that.
  std::optional<ParticleLoad> couples;
  std::vector<TractionLoad> tractions;
  std::vector<PressureLoad> pressures;
  std::vector<PrescribedMotion> prescribed;
  std::vector<RigidDrive> rigid_drives;
  std::vector<MomentLoad> moments;
  std::optional<SurfaceMotion> surface;  // of another participant, in `advance` of impacts only
  ContactSettings contact;               // none when it names no body
  std::array<double, 2> gravity{};       // [m/s2]
  std::array<bool, 2> held{};            // components of the displacement that stay zero, in `advance` only
};

/// The sum of all loads (without gravity) on the particles they touch, step by step, and the work they do.
class ExternalForces {
public:
  ExternalForces(const Body& body, const Loading& loading);

  /// Forces at `time`, `fraction` of the window gone.
  void set(double fraction, double time, std::span<const double> displacement);
  /// Adds the forces last set to `force`.
  void add_to(std::vector<double>& force) const;
  /// Trapezoidal work between the last two calls of `set`.
  [[nodiscard]] double work() const { return work_; }

private:
  const Body& body_;
  const Loading& loading_;
  std::vector<std::uint32_t> touched_;
  std::vector<std::uint32_t> place_;  // of every particle in `touched_`
  std::vector<double> force_, last_force_, last_displacement_;
  double work_ = 0;
  bool started_ = false;
};

}  // namespace estuary::solid
