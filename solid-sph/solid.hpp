// The SPH solid as a participant: bodies in two dimensions, transient or steady. solid_motion.cpp runs its
// windows, solid_surface.cpp is the wet surface, solid_watch.cpp says what is watched, solid_files.cpp
// writes.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "expression.hpp"
#include "field_file.hpp"
#include "newton.hpp"
#include "participant.hpp"
#include "solid_scene.hpp"
#include "surface_transfer.hpp"

namespace estuary::solid {

class Solid final : public Participant {
public:
  [[nodiscard]] Identity identity() const override;
  Plan configure(Scene& scene, const std::string& role) override;
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& folder) override;
  AdvanceResult advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) override;
  [[nodiscard]] std::optional<double> window_step() const override { return 0.0; }
  void accept() override;
  void save(const std::filesystem::path& file) override;
  void load(const std::filesystem::path& file) override;
  std::vector<std::string> frame(std::uint64_t number, double time) override;

private:
  struct PointWatch {
    std::string name;
    std::array<double, 2> point{};
    std::optional<std::size_t> body;              // totals of one
    std::optional<std::size_t> rigid;             // the rigid body it lies in
    std::optional<Transfer> transfer;             // else; none for totals
    std::optional<std::array<double, 4>> region;  // what passes through it
    std::optional<std::size_t> hold;              // what one holds with
    std::vector<std::uint32_t> held;              // its particles
  };

  void build(const v1::Exchange& initial);
  void build_surface();
  void take_forces(const Window& window, const v1::Exchange& inputs);
  void integrate(const Window& window, const Monitor& monitor);
  /// Takes particles without a link out of the motion, and notes what they had.
  void remove_isolated();
  double find_equilibrium(const Window& window, const Monitor& monitor);
  [[nodiscard]] std::vector<std::pair<std::string, double>> body_quantities(std::size_t member) const;
  double settle_rigid_bodies(double time);
  [[nodiscard]] std::optional<std::size_t> rigid_at(const std::array<double, 2>& point, double slip) const;
  [[nodiscard]] std::vector<std::pair<std::string, double>> rigid_quantities(
      std::size_t rigid, const std::array<double, 2>& point) const;
  [[noreturn]] void fail(const Breakdown& breakdown, const Window& window);
  void keep_last_state();
  [[nodiscard]] std::uint64_t steps_for(double duration);
  void fill_displacements(v1::Displacements& field) const;
  [[nodiscard]] std::vector<WatchValues> watch_values(double time);
  [[nodiscard]] NamedValues region_quantities(const std::array<double, 4>& region) const;
  void add_quantities(const Transfer& transfer, NamedValues& quantities) const;
  /// Force and moment about the origin of what holds or moves particles, in all or by one [[solid.hold]],
  /// without the inertia of particles that it moves.
  [[nodiscard]] std::array<double, 3> reaction(double time);
  [[nodiscard]] std::array<double, 3> reaction_of(const std::vector<std::uint32_t>& particles,
                                                  const std::array<bool, 2>& component,
                                                  const std::vector<double>& external) const;
  /// Cauchy xx yy xy zz, von Mises, equivalent plastic strain and damage of a particle.
  [[nodiscard]] std::array<double, 7> particle_stress(std::size_t particle) const;
  [[nodiscard]] std::array<double, 7> stress_at(const Transfer& transfer) const;
  void add_surface_resultants(AdvanceResult& result) const;
  void write_particles(const std::filesystem::path& file) const;
  void write_surface(const std::filesystem::path& file) const;

  SolidScene scene_;
  std::optional<Body> placed_;  // by configure, for the start
  std::filesystem::path folder_;
  Body body_;
  std::unique_ptr<Solver> solver_;
  std::unique_ptr<NewtonSolver> newton_;
  std::vector<std::unique_ptr<Expression>> expressions_;
  std::optional<Contact> contact_;
  Loading loading_;                // the last particle load is the wet surface when there is one
  std::vector<double> wet_nodes_;  // reference positions [m]; empty without a wet surface
  Transfer transfer_;
  std::optional<Transfer> arms_;  // of shells: distances of the nodes along the fibres
  v1::WetSurface surface_;
  std::vector<std::array<std::uint32_t, 2>> facets_;  // particles of each, of a surface that tears
  std::optional<DrivenSurface> driven_;               // of the scene's solid, in the part of a fluid
  std::vector<PointWatch> watches_;
  State state_, accepted_;
  std::vector<double> forces_, accepted_forces_;  // on the wet nodes
  std::vector<double> earlier_forces_;            // at the start of the window before; empty in the first
  double duration_ = 0, earlier_duration_ = 0;    // of the window and of that before [s]
  Work work_;
  double step_seconds_ = 0, transfer_seconds_ = 0;
  std::unique_ptr<FieldSeries> particle_series_, surface_series_;
};

}  // namespace estuary::solid
