#include "radial_basis.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

// Nodes nearer than this share of the surface's extent are one node.
constexpr double same_place = 1e-10;
// A direction with less than this share of the largest extent is none.
constexpr double flat = 1e-9;

using Point = Eigen::Vector3d;  // with z = 0 in two dimensions

std::vector<Point> positions_of(const v1::WetSurface& surface) {
  const auto dimension = static_cast<int>(surface.dimension());
  std::vector<Point> points(node_count(surface), Point::Zero());
  for (std::size_t k = 0; k < points.size(); ++k) {
    for (int axis = 0; axis < dimension; ++axis)
      points[k][axis] = surface.reference_positions(static_cast<int>(k) * dimension + axis);
  }
  return points;
}

double extent_of(const std::vector<Point>& points) {
  Point lowest = points.front();
  Point highest = points.front();
  for (const Point& point : points) {
    lowest = lowest.cwiseMin(point);
    highest = highest.cwiseMax(point);
  }
  return (highest - lowest).maxCoeff();
}

double basis(MappingKind kind, double r) {
  switch (kind) {
    case MappingKind::wendland_c2:
      return r < 1 ? std::pow(1 - r, 4) * (4 * r + 1) : 0.0;
    case MappingKind::wendland_c4:
      return r < 1 ? std::pow(1 - r, 6) * (35 * r * r + 18 * r + 3) / 3 : 0.0;
    default:
      return r > 0 ? r * r * std::log(r) : 0.0;
  }
}

// Groups of nodes at the same place, each with its lowest number first.
std::vector<std::vector<std::uint32_t>> places_of(const std::vector<Point>& points, double extent) {
  std::vector<std::vector<std::uint32_t>> places;
  std::vector<std::uint32_t> by_x(points.size());
  for (std::size_t k = 0; k < by_x.size(); ++k) by_x[k] = static_cast<std::uint32_t>(k);
  std::sort(by_x.begin(), by_x.end(), [&](std::uint32_t a, std::uint32_t b) {
    return points[a].x() != points[b].x() ? points[a].x() < points[b].x() : a < b;
  });
  std::vector<bool> taken(by_x.size(), false);
  const double near = same_place * extent;
  for (std::size_t k = 0; k < by_x.size(); ++k) {
    const std::uint32_t first = by_x[k];
    if (taken[first]) continue;
    auto& place = places.emplace_back();
    for (std::size_t l = k; l < by_x.size() && points[by_x[l]].x() - points[first].x() <= near; ++l) {
      const std::uint32_t other = by_x[l];
      if (taken[other] || (points[other] - points[first]).norm() > near) continue;
      taken[other] = true;
      place.push_back(other);
    }
  }
  return places;
}

// The constant and the coordinates along which the points have an extent.
class LinearPolynomial {
public:
  explicit LinearPolynomial(const std::vector<Point>& points) {
    for (const Point& point : points) centre_ += point / static_cast<double>(points.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Point& point : points) spread += (point - centre_) * (point - centre_).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
    const double largest = std::sqrt(std::max(0.0, principal.eigenvalues().maxCoeff()));
    for (int k = 0; k < 3; ++k) {
      const Point along = principal.eigenvectors().col(k);
      double extent = 0;
      for (const Point& point : points) extent = std::max(extent, std::abs((point - centre_).dot(along)));
      if (largest > 0 && extent > flat * largest) axes_.emplace_back(along / extent);
    }
  }
  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(axes_.size()) + 1; }
  [[nodiscard]] double at(const Point& point, Eigen::Index term) const {
    return term == 0 ? 1.0 : (point - centre_).dot(axes_[static_cast<std::size_t>(term) - 1]);
  }

private:
  Point centre_ = Point::Zero();
  std::vector<Point> axes_;
};

void require_reach(const std::vector<Point>& from, const std::vector<Point>& to, double radius) {
  for (std::size_t k = 0; k < to.size(); ++k) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Point& point : from) nearest = std::min(nearest, (point - to[k]).norm());
    if (!(nearest < radius)) {
      throw std::invalid_argument(
          fmt::format("coupling.mapping.support_radius: {:g} m reaches no node from node {} of the other "
                      "surface, which is {:g} m away; use several times the spacing of the nodes",
                      radius, k, nearest));
    }
  }
}

}  // namespace

std::vector<std::vector<Mapping::Entry>> radial_basis_rows(const MappingSettings& settings,
                                                           const v1::WetSurface& source,
                                                           const v1::WetSurface& target) {
  const std::vector<Point> all = positions_of(source);
  const std::vector<Point> to = positions_of(target);
  const double extent = extent_of(all);
  const auto places = places_of(all, extent);
  if (places.size() > most_radial_nodes || all.size() * to.size() > most_radial_weights) {
    throw std::invalid_argument(fmt::format(
        "coupling.mapping.kind: radial basis functions between {} and {} nodes need a dense matrix "
        "that is too large (most: {} nodes, {} weights); use \"nearest-projection\"",
        all.size(), to.size(), most_radial_nodes, most_radial_weights));
  }
  std::vector<Point> from;
  for (const auto& place : places) from.push_back(all[place.front()]);

  const bool compact = settings.kind != MappingKind::thin_plate_spline;
  if (compact) require_reach(from, to, settings.support_radius);
  const double unit = compact ? settings.support_radius : std::max(extent, 1e-300);
  const auto phi = [&](const Point& a, const Point& b) {
    return basis(settings.kind, (a - b).norm() / unit);
  };
  const LinearPolynomial polynomial(from);
  const auto count = static_cast<Eigen::Index>(from.size());
  const Eigen::Index size = count + polynomial.size();
  const auto columns = static_cast<Eigen::Index>(to.size());
  Eigen::MatrixXd system(size, size);
  system.setZero();
  Eigen::MatrixXd weights(size, columns);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Point& here = from[static_cast<std::size_t>(i)];
    for (Eigen::Index j = 0; j <= i; ++j)
      system(i, j) = system(j, i) = phi(here, from[static_cast<std::size_t>(j)]);
    for (Eigen::Index term = 0; term < polynomial.size(); ++term)
      system(i, count + term) = system(count + term, i) = polynomial.at(here, term);
  }
  for (Eigen::Index k = 0; k < columns; ++k) {
    const Point& there = to[static_cast<std::size_t>(k)];
    for (Eigen::Index i = 0; i < count; ++i) weights(i, k) = phi(there, from[static_cast<std::size_t>(i)]);
    for (Eigen::Index term = 0; term < polynomial.size(); ++term)
      weights(count + term, k) = polynomial.at(there, term);
  }
  const Eigen::PartialPivLU<Eigen::MatrixXd> factors(system);
  weights = factors.solve(weights);
  // Functions so alike that their matrix cannot be solved in double precision.
  const double condition = factors.rcond();
  double defect = 0;
  for (Eigen::Index k = 0; k < columns; ++k) {
    double sum = 0;
    for (Eigen::Index i = 0; i < count; ++i) sum += weights(i, k);
    if (!(std::abs(sum - 1) <= defect)) defect = std::abs(sum - 1);
  }
  if (!(condition > 1e-15) || !(defect < 1e-6)) {
    throw std::invalid_argument(fmt::format(
        "coupling.mapping: the radial basis functions of {} nodes are nearly dependent (reciprocal "
        "condition number {:.1e}, constants off by {:.1e}); use a smaller "
        "coupling.mapping.support_radius or \"nearest-projection\"",
        count, condition, defect));
  }
  std::vector<std::vector<Mapping::Entry>> rows(to.size());
  for (Eigen::Index k = 0; k < columns; ++k) {
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto& place = places[static_cast<std::size_t>(i)];
      for (const std::uint32_t node : place)
        rows[static_cast<std::size_t>(k)].push_back(
            {node, weights(i, k) / static_cast<double>(place.size())});
    }
  }
  return rows;
}

}  // namespace estuary::coupler
