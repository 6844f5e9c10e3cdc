#include "wet_surface.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace estuary {

namespace {

constexpr int most_nodes = 10'000'000;  // exclusive

using Doubles = google::protobuf::RepeatedField<double>;

/// Throws unless `values` are `components` finite numbers for each of `nodes` nodes.
void check_values(const Doubles& values, std::size_t nodes, std::size_t components, const char* field) {
  if (static_cast<std::size_t>(values.size()) != nodes * components) {
    throw std::invalid_argument(fmt::format("{}: has {} values; the surface has {} nodes and needs {}", field,
                                            values.size(), nodes, nodes * components));
  }
  for (int i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      const auto place = static_cast<std::size_t>(i);
      throw std::invalid_argument(fmt::format("{}: component {} of node {} is {}; it must be finite", field,
                                              place % components, place / components, values[i]));
    }
  }
}

void check_identity(std::uint64_t identity, const v1::WetSurface& surface, const char* field) {
  if (identity != surface.identity()) {
    throw std::invalid_argument(fmt::format("{}: belongs to the surface {}; the surface of this run is {}",
                                            field, identity, surface.identity()));
  }
}

}  // namespace

std::size_t node_count(const v1::WetSurface& surface) {
  return surface.dimension() == 0
             ? 0
             : static_cast<std::size_t>(surface.reference_positions_size()) / surface.dimension();
}

void check_wet_surface(const v1::WetSurface& surface) {
  const auto dimension = surface.dimension();
  if (dimension != 2 && dimension != 3) {
    throw std::invalid_argument(fmt::format("WetSurface.dimension: is {}; must be 2 or 3", dimension));
  }
  const auto& positions = surface.reference_positions();
  if (positions.empty() || static_cast<std::size_t>(positions.size()) % dimension != 0) {
    throw std::invalid_argument(fmt::format(
        "WetSurface.reference_positions: has {} values; expected {} for each of at least one node",
        positions.size(), dimension));
  }
  const std::size_t nodes = node_count(surface);
  if (nodes >= most_nodes) {
    throw std::invalid_argument(fmt::format(
        "WetSurface.reference_positions: holds {} nodes; must be fewer than {}", nodes, most_nodes));
  }
  check_values(positions, nodes, dimension, "WetSurface.reference_positions");

  const auto& connectivity = surface.connectivity();
  if (connectivity.empty() || static_cast<std::size_t>(connectivity.size()) % dimension != 0) {
    throw std::invalid_argument(
        fmt::format("WetSurface.connectivity: has {} entries; expected {} for each of at least one facet",
                    connectivity.size(), dimension));
  }
  const int corners = static_cast<int>(dimension);
  for (int first = 0; first < connectivity.size(); first += corners) {
    for (int corner = 0; corner < corners; ++corner) {
      const auto node = connectivity[first + corner];
      if (node >= nodes) {
        throw std::invalid_argument(
            fmt::format("WetSurface.connectivity: facet {} names node {}; the nodes are 0 to {}",
                        first / corners, node, nodes - 1));
      }
      for (int other = 0; other < corner; ++other) {
        if (connectivity[first + other] == node) {
          throw std::invalid_argument(
              fmt::format("WetSurface.connectivity: facet {} names node {} twice", first / corners, node));
        }
      }
    }
  }
}

void check_displacements(const v1::Displacements& field, const v1::WetSurface& surface) {
  check_identity(field.surface(), surface, "Displacements.surface");
  const std::size_t nodes = node_count(surface);
  check_values(field.displacement(), nodes, surface.dimension(), "Displacements.displacement");
  check_values(field.velocity(), nodes, surface.dimension(), "Displacements.velocity");
  const auto facets = static_cast<std::uint32_t>(surface.connectivity_size()) / surface.dimension();
  if (!field.torn().empty() && !surface.tears())
    throw std::invalid_argument("Displacements.torn: names facets of a surface that does not tear");
  for (int k = 0; k < field.torn_size(); ++k)
    if (field.torn(k) >= facets || (k > 0 && field.torn(k) <= field.torn(k - 1)))
      throw std::invalid_argument(fmt::format(
          "Displacements.torn: names facet {} at place {}; the facets are 0 to {}, in ascending order",
          field.torn(k), k, facets - 1));
}

void check_pressures(const v1::WetSurfacePressures& field, const v1::WetSurface& surface) {
  check_identity(field.surface(), surface, "WetSurfacePressures.surface");
  const std::size_t nodes = node_count(surface);
  check_values(field.pressure(), nodes, 1, "WetSurfacePressures.pressure");
  if (!field.viscous_traction().empty()) {
    check_values(field.viscous_traction(), nodes, surface.dimension(),
                 "WetSurfacePressures.viscous_traction");
  }
}

void check_forces(const v1::NodalForces& field, const v1::WetSurface& surface) {
  check_identity(field.surface(), surface, "NodalForces.surface");
  check_values(field.force(), node_count(surface), surface.dimension(), "NodalForces.force");
}

}  // namespace estuary
