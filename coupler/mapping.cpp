#include "mapping.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "nearest_facet.hpp"
#include "radial_basis.hpp"
#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

using Rows = std::vector<std::vector<Mapping::Entry>>;

Rows nearest_rows(const v1::WetSurface& source, const v1::WetSurface& target, NearestTo kind) {
  const NearestFacet search(source, kind);
  const std::size_t dimension = target.dimension();
  Rows rows(node_count(target));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const FacetPoint found = search.find({target.reference_positions().data() + k * dimension, dimension});
    for (std::size_t corner = 0; corner < found.count; ++corner)
      if (found.weight[corner] != 0) rows[k].push_back({found.node[corner], found.weight[corner]});
  }
  return rows;
}

}  // namespace

Mapping::Mapping(std::size_t sources, const std::vector<std::vector<Entry>>& rows) : sources_(sources) {
  row_begin_.reserve(rows.size() + 1);
  row_begin_.push_back(0);
  for (const auto& row : rows) {
    entries_.insert(entries_.end(), row.begin(), row.end());
    row_begin_.push_back(entries_.size());
  }
}

std::vector<double> Mapping::consistent(std::span<const double> values, std::size_t components) const {
  if (values.size() != sources_ * components)
    throw std::invalid_argument(fmt::format("a mapping from {} nodes was given {} values of {} components",
                                            sources_, values.size(), components));
  std::vector<double> result(targets() * components, 0.0);
  for (std::size_t k = 0; k < targets(); ++k) {
    for (std::size_t e = row_begin_[k]; e < row_begin_[k + 1]; ++e) {
      const Entry& entry = entries_[e];
      for (std::size_t c = 0; c < components; ++c)
        result[k * components + c] += entry.weight * values[entry.source * components + c];
    }
  }
  return result;
}

std::vector<double> Mapping::conservative(std::span<const double> loads, std::size_t components) const {
  if (loads.size() != targets() * components)
    throw std::invalid_argument(fmt::format("a mapping to {} nodes was given {} loads of {} components",
                                            targets(), loads.size(), components));
  std::vector<double> result(sources_ * components, 0.0);
  for (std::size_t k = 0; k < targets(); ++k) {
    for (std::size_t e = row_begin_[k]; e < row_begin_[k + 1]; ++e) {
      const Entry& entry = entries_[e];
      for (std::size_t c = 0; c < components; ++c)
        result[entry.source * components + c] += entry.weight * loads[k * components + c];
    }
  }
  return result;
}

MappingQuality quality_of(const Mapping& mapping, const v1::WetSurface& source,
                          const v1::WetSurface& target) {
  const std::size_t dimension = source.dimension();
  const auto& from = source.reference_positions();
  const auto& to = target.reference_positions();
  const auto ones = mapping.consistent(std::vector<double>(mapping.sources(), 1.0), 1);
  const auto places = mapping.consistent({from.data(), static_cast<std::size_t>(from.size())}, dimension);
  MappingQuality quality;
  for (std::size_t k = 0; k < mapping.targets(); ++k) {
    quality.constant_defect = std::max(quality.constant_defect, std::abs(ones[k] - 1));
    double square = 0;
    for (std::size_t c = 0; c < dimension; ++c) {
      const double gap = places[k * dimension + c] - to[static_cast<int>(k * dimension + c)];
      square += gap * gap;
    }
    quality.largest_distance = std::max(quality.largest_distance, std::sqrt(square));
  }
  return quality;
}

Mapping make_mapping(const MappingSettings& settings, const v1::WetSurface& source,
                     const v1::WetSurface& target) {
  check_wet_surface(source);
  check_wet_surface(target);
  if (source.dimension() != target.dimension())
    throw std::invalid_argument(fmt::format("the surfaces have {} and {} dimensions and cannot be mapped",
                                            source.dimension(), target.dimension()));
  switch (settings.kind) {
    case MappingKind::nearest_neighbour:
      return {node_count(source), nearest_rows(source, target, NearestTo::nodes)};
    case MappingKind::nearest_projection:
      return {node_count(source), nearest_rows(source, target, NearestTo::facets)};
    case MappingKind::thin_plate_spline:
    case MappingKind::wendland_c2:
    case MappingKind::wendland_c4:
      break;
  }
  return {node_count(source), radial_basis_rows(settings, source, target)};
}

}  // namespace estuary::coupler
