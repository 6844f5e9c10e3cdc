#include "radial_basis.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "wet_surface.hpp"

namespace estuary::coupler {
namespace {

// Nodes nearer than this share of the surface's extent are one node.
constexpr double same_place = 1e-10;
// A direction with less than this share of the largest extent is none.
constexpr double flat = 1e-9;

using Matrix = Eigen::MatrixXd;  // points: one row each

Matrix positions_of(const v1::WetSurface& surface) {
  const auto dimension = static_cast<Eigen::Index>(surface.dimension());
  const auto nodes = static_cast<Eigen::Index>(node_count(surface));
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      surface.reference_positions().data(), nodes, dimension);
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
std::vector<std::vector<std::uint32_t>> places_of(const Matrix& points, double extent) {
  std::vector<std::vector<std::uint32_t>> places;
  std::vector<Eigen::Index> by_x(static_cast<std::size_t>(points.rows()));
  for (std::size_t k = 0; k < by_x.size(); ++k) by_x[k] = static_cast<Eigen::Index>(k);
  std::sort(by_x.begin(), by_x.end(), [&](Eigen::Index a, Eigen::Index b) {
    return points(a, 0) != points(b, 0) ? points(a, 0) < points(b, 0) : a < b;
  });
  std::vector<bool> taken(by_x.size(), false);
  const double near = same_place * extent;
  for (std::size_t k = 0; k < by_x.size(); ++k) {
    const Eigen::Index first = by_x[k];
    if (taken[static_cast<std::size_t>(first)]) continue;
    auto& place = places.emplace_back();
    for (std::size_t l = k; l < by_x.size() && points(by_x[l], 0) - points(first, 0) <= near; ++l) {
      const Eigen::Index other = by_x[l];
      if (taken[static_cast<std::size_t>(other)] || (points.row(other) - points.row(first)).norm() > near)
        continue;
      taken[static_cast<std::size_t>(other)] = true;
      place.push_back(static_cast<std::uint32_t>(other));
    }
  }
  return places;
}

// The constant and the coordinates along which the points have an extent.
class LinearPolynomial {
public:
  explicit LinearPolynomial(const Matrix& points) : centre_(points.colwise().mean()) {
    const Matrix centred = points.rowwise() - centre_;
    const Eigen::SelfAdjointEigenSolver<Matrix> axes(centred.transpose() * centred);
    const double largest = std::sqrt(std::max(0.0, axes.eigenvalues().maxCoeff()));
    for (Eigen::Index k = 0; k < axes.eigenvalues().size(); ++k) {
      const Eigen::RowVectorXd along = axes.eigenvectors().col(k).transpose();
      const double extent = (centred * along.transpose()).cwiseAbs().maxCoeff();
      if (largest > 0 && extent > flat * largest) axes_.push_back(along / extent);
    }
  }
  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(axes_.size()) + 1; }
  [[nodiscard]] Eigen::RowVectorXd at(const Eigen::RowVectorXd& point) const {
    Eigen::RowVectorXd values(size());
    values[0] = 1;
    for (std::size_t k = 0; k < axes_.size(); ++k)
      values[static_cast<Eigen::Index>(k) + 1] = (point - centre_).dot(axes_[k]);
    return values;
  }

private:
  Eigen::RowVectorXd centre_;
  std::vector<Eigen::RowVectorXd> axes_;
};

void require_reach(const Matrix& from, const Matrix& to, double radius) {
  for (Eigen::Index k = 0; k < to.rows(); ++k) {
    const double nearest = (from.rowwise() - to.row(k)).rowwise().norm().minCoeff();
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
  const Matrix all = positions_of(source);
  const Matrix to = positions_of(target);
  const double extent = (all.colwise().maxCoeff() - all.colwise().minCoeff()).maxCoeff();
  const auto places = places_of(all, extent);
  const auto count = static_cast<Eigen::Index>(places.size());
  if (places.size() > most_radial_nodes ||
      static_cast<std::size_t>(all.rows()) * static_cast<std::size_t>(to.rows()) > most_radial_weights) {
    throw std::invalid_argument(fmt::format(
        "coupling.mapping.kind: radial basis functions between {} and {} nodes need a dense matrix "
        "that is too large (most: {} nodes, {} weights); use \"nearest-projection\"",
        all.rows(), to.rows(), most_radial_nodes, most_radial_weights));
  }
  Matrix from(count, all.cols());
  for (Eigen::Index k = 0; k < count; ++k) from.row(k) = all.row(places[static_cast<std::size_t>(k)].front());

  const bool compact = settings.kind != MappingKind::thin_plate_spline;
  if (compact) require_reach(from, to, settings.support_radius);
  const double unit = compact ? settings.support_radius : std::max(extent, 1e-300);
  const auto phi = [&](const Eigen::RowVectorXd& a, const Eigen::RowVectorXd& b) {
    return basis(settings.kind, (a - b).norm() / unit);
  };
  const LinearPolynomial polynomial(from);
  const Eigen::Index size = count + polynomial.size();
  Matrix system = Matrix::Zero(size, size);
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) system(i, j) = system(j, i) = phi(from.row(i), from.row(j));
    system.row(i).tail(polynomial.size()) = polynomial.at(from.row(i));
    system.col(i).tail(polynomial.size()) = system.row(i).tail(polynomial.size()).transpose();
  }
  Matrix right(size, to.rows());
  for (Eigen::Index k = 0; k < to.rows(); ++k) {
    for (Eigen::Index i = 0; i < count; ++i) right(i, k) = phi(to.row(k), from.row(i));
    right.col(k).tail(polynomial.size()) = polynomial.at(to.row(k)).transpose();
  }
  const Eigen::PartialPivLU<Matrix> factors(system);
  const Matrix weights = factors.solve(right);
  // Functions so alike that their matrix cannot be solved in double precision.
  const double condition = factors.rcond();
  const double defect = (weights.topRows(count).colwise().sum().array() - 1).abs().maxCoeff();
  if (!(condition > 1e-15) || !(defect < 1e-6)) {
    throw std::invalid_argument(fmt::format(
        "coupling.mapping: the radial basis functions of {} nodes are nearly dependent (reciprocal "
        "condition number {:.1e}, constants off by {:.1e}); use a smaller "
        "coupling.mapping.support_radius or \"nearest-projection\"",
        count, condition, defect));
  }
  std::vector<std::vector<Mapping::Entry>> rows(static_cast<std::size_t>(to.rows()));
  for (Eigen::Index k = 0; k < to.rows(); ++k) {
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
