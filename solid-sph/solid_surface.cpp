// The wet surface of a solid: what it brings, the forces it takes, the motion it gives.
#include <algorithm>
#include <cstring>

#include "body_conditions.hpp"
#include "shell_faces.hpp"
#include "solid.hpp"
#include "wet_surface.hpp"

namespace estuary::solid {
namespace {

// Fowler-Noll-Vo hash of everything a receiver relies on.
std::uint64_t identity_of(const v1::WetSurface& surface) {
  std::uint64_t hash = 1469598103934665603ULL;
  const auto mix = [&](std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte, bits >>= 8) hash = (hash ^ (bits & 0xff)) * 1099511628211ULL;
  };
  for (const double x : surface.reference_positions()) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &x, sizeof bits);
    mix(bits);
  }
  for (const auto node : surface.connectivity()) mix(node);
  mix(surface.closed() ? 1 : 0);
  return hash == 0 ? 1 : hash;
}

}  // namespace

void Solid::build_surface() {
  expressions_.clear();
  loading_ = build_loading(scene_, body_, expressions_);
  contact_.reset();
  if (scene_.contact && !scene_.impact()) contact_.emplace(body_, loading_.contact);
  wet_nodes_.clear();
  surface_.Clear();
  std::vector<ContourLine> lines;
  arms_.reset();
  if (scene_.wet_contour && solver_->shells() != nullptr) {
    ShellFaces faces = shell_faces(body_, *solver_->shells());
    lines = std::move(faces.lines);
    transfer_ = std::move(faces.mid_line);
    arms_ = std::move(faces.arm);
  } else if (scene_.wet_contour)
    lines = free_contours(body_);
  else if (!scene_.wet.empty())
    lines.push_back(contour_line(body_, scene_.wet));
  facets_.clear();
  if (lines.empty()) return;
  if (!arms_) transfer_ = contour_transfer(body_, lines);
  ParticleLoad wet;
  wet.particle = transfer_.touched;
  wet.start.assign(2 * wet.particle.size(), 0.0);
  wet.end = wet.start;
  if (arms_) loading_.couples = wet;
  loading_.loads.push_back(std::move(wet));
  surface_.set_dimension(2);
  surface_.set_closed(true);
  for (const ContourLine& line : lines) {
    const std::size_t first = wet_nodes_.size() / 2;
    wet_nodes_.insert(wet_nodes_.end(), line.position.begin(), line.position.end());
    for (std::size_t s = 0; s < line.segments(); ++s) {
      surface_.add_connectivity(static_cast<std::uint32_t>(first + s));
      surface_.add_connectivity(static_cast<std::uint32_t>(first + (s + 1) % line.size()));
    }
    surface_.set_closed(surface_.closed() && line.closed);
  }
  surface_.set_tears(arms_ && scene_.breaks());
  if (surface_.tears())
    for (int f = 0; f < surface_.connectivity_size(); f += 2) {
      const auto particle = [&](int end) {
        return arms_->touched[arms_->position[surface_.connectivity(f + end)]];
      };
      facets_.push_back({particle(0), particle(1)});
    }
  surface_.mutable_reference_positions()->Add(wet_nodes_.begin(), wet_nodes_.end());
  surface_.set_identity(identity_of(surface_));
  forces_.assign(wet_nodes_.size(), 0.0);
  accepted_forces_ = forces_;
  earlier_forces_.clear();
}

void Solid::fill_displacements(v1::Displacements& field) const {
  field.set_surface(surface_.identity());
  const auto count = static_cast<int>(wet_nodes_.size());
  field.mutable_displacement()->Resize(count, 0.0);
  field.mutable_velocity()->Resize(count, 0.0);
  const auto n = static_cast<std::size_t>(count);
  interpolate(transfer_, state_.displacement, {field.mutable_displacement()->mutable_data(), n});
  interpolate(transfer_, state_.velocity, {field.mutable_velocity()->mutable_data(), n});
  field.clear_torn();
  if (!arms_) return;
  if (!facets_.empty()) {
    // Both faces of a broken link; its particles may come in either order, those of an end are one.
    const auto broken = solver_->shells()->broken_links(state_.history);
    for (std::size_t f = 0; f < facets_.size() && !broken.empty(); ++f)
      if (std::any_of(broken.begin(), broken.end(), [&](const std::array<std::uint32_t, 2>& link) {
            return link == facets_[f] || (link[0] == facets_[f][1] && link[1] == facets_[f][0]);
          }))
        field.add_torn(static_cast<std::uint32_t>(f));
  }
  for (std::size_t k = 0; k < arms_->points(); ++k) {
    const auto [change, rate] =
        solver_->shells()->fibre_motion(arms_->touched[arms_->position[k]], state_.history);
    for (std::size_t c = 0; c < 2; ++c) {
      const auto at = static_cast<int>(2 * k + c);
      (*field.mutable_displacement())[at] += arms_->weight[k] * change[c];
      (*field.mutable_velocity())[at] += arms_->weight[k] * rate[c];
    }
  }
}

void Solid::take_forces(const Window& window, const v1::Exchange& inputs) {
  if (driven_) {
    try {
      loading_.surface = driven_->window(accepted_, inputs.displacements(), window.time, window.duration);
    } catch (const std::invalid_argument& error) {
      throw BadInput("inputs.displacements", error.what());
    }
  }
  if (wet_nodes_.empty()) {
    if (inputs.has_forces())
      throw BadInput("inputs.forces", "forces were sent, but this solid has no wet side");
    return;
  }
  // A solid running alone is given none.
  if (scene_.coupled && !inputs.has_forces())
    throw BadInput("inputs.forces", "the forces on the wet surface are missing");
  if (inputs.has_forces()) {
    try {
      check_forces(inputs.forces(), surface_);
    } catch (const std::invalid_argument& error) {
      throw BadInput("inputs.forces", error.what());
    }
    forces_.assign(inputs.forces().force().begin(), inputs.forces().force().end());
  } else {
    std::fill(forces_.begin(), forces_.end(), 0.0);
  }
  // By default the mean of the loads at both ends acts through the whole window. It makes the same impulse as
  // a load that changes linearly, but on a body much softer than what pushes it (a closed fluid layer) it is
  // the method of constant average acceleration, stable for any window, where the ramp is that of linear
  // acceleration, which is not. A partner that sends the mean of its own window wants it unchanged.
  duration_ = window.duration;
  std::vector<double> start = forces_, end = forces_, bend;
  if (scene_.mode == Mode::transient && scene_.window_load != WindowLoad::received) {
    const bool mean = scene_.window_load == WindowLoad::mean;
    for (std::size_t k = 0; k < end.size(); ++k) {
      start[k] = mean ? 0.5 * (accepted_forces_[k] + forces_[k]) : accepted_forces_[k];
      if (mean) end[k] = start[k];
    }
  }
  if (scene_.window_load == WindowLoad::quadratic && !earlier_forces_.empty()) {
    const double r = earlier_duration_ / duration_;
    for (std::size_t k = 0; k < end.size(); ++k)
      bend.push_back((earlier_forces_[k] - start[k] + r * (end[k] - start[k])) / (r * (r + 1)));
  }
  const auto act = [&](const Transfer& transfer, ParticleLoad& wet) {
    spread(transfer, start, wet.start);
    spread(transfer, end, wet.end);
    wet.bend.clear();
    if (!bend.empty()) spread(transfer, bend, wet.bend);
  };
  act(transfer_, loading_.loads.back());
  if (arms_) act(*arms_, *loading_.couples);
}

void Solid::add_surface_resultants(AdvanceResult& result) const {
  const auto& displacement = result.outputs.displacements().displacement();
  double fx = 0, fy = 0, moment = 0;
  for (std::size_t k = 0; k < wet_nodes_.size() / 2; ++k) {
    const auto c = static_cast<int>(2 * k);
    const double x = wet_nodes_[2 * k] + displacement[c], y = wet_nodes_[2 * k + 1] + displacement[c + 1];
    fx += forces_[2 * k];
    fy += forces_[2 * k + 1];
    moment += x * forces_[2 * k + 1] - y * forces_[2 * k];
  }
  result.surface_force = {fx, fy};
  result.surface_moment = moment;
}

}  // namespace estuary::solid
