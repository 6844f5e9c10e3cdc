#include "surface_link.hpp"

#include <fmt/format.h>

#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

std::span<const double> span_of(const google::protobuf::RepeatedField<double>& values) {
  return {values.data(), static_cast<std::size_t>(values.size())};
}

}  // namespace

SurfaceLink::SurfaceLink(v1::WetSurface own, const v1::WetSurface& solid, const MappingSettings& settings,
                         Loads loads)
    : own_(std::move(own)), solid_(solid), from_solid_(make_mapping(settings, solid, own_)) {
  if (loads == Loads::pressures) to_solid_ = make_mapping(settings, own_, solid);
}

WetMotion SurfaceLink::motion(const WetMotion& solid) const {
  const std::size_t dimension = own_.dimension();
  return {from_solid_.consistent(solid.displacement, dimension),
          from_solid_.consistent(solid.velocity, dimension)};
}

std::vector<double> SurfaceLink::forces(const v1::WetSurfacePressures& load, const WetMotion& motion,
                                        LoadSums& sums) const {
  const WetMotion own_motion = this->motion(motion);
  const v1::NodalForces own = consistent_nodal_forces(own_, own_motion.displacement, load);
  sums = sum_load(own_, own_motion.displacement, own_motion.velocity, span_of(own.force()));
  if (!to_solid_) return from_solid_.conservative(span_of(own.force()), own_.dimension());
  v1::WetSurfacePressures mapped;
  const auto pressure = to_solid_->consistent(span_of(load.pressure()), 1);
  mapped.mutable_pressure()->Assign(pressure.begin(), pressure.end());
  if (!load.viscous_traction().empty()) {
    const auto traction = to_solid_->consistent(span_of(load.viscous_traction()), own_.dimension());
    mapped.mutable_viscous_traction()->Assign(traction.begin(), traction.end());
  }
  const v1::NodalForces result = consistent_nodal_forces(solid_, motion.displacement, mapped);
  return {result.force().begin(), result.force().end()};
}

std::vector<double> SurfaceLink::forces(const v1::NodalForces& own, const WetMotion& motion,
                                        LoadSums& sums) const {
  const WetMotion own_motion = this->motion(motion);
  sums = sum_load(own_, own_motion.displacement, own_motion.velocity, span_of(own.force()));
  return from_solid_.conservative(span_of(own.force()), own_.dimension());
}

std::string SurfaceLink::description() const {
  const MappingQuality quality = quality_of(from_solid_, solid_, own_);
  return fmt::format("{} nodes on the solid's {}, at most {:.3g} m off them, constants kept to {:.1e}",
                     node_count(own_), node_count(solid_), quality.largest_distance, quality.constant_defect);
}

}  // namespace estuary::coupler
