// Independent references of a cantilever under a dead load at its end: the elastica, Reissner's beam, which
// also shears and stretches, and biquadratic finite elements of the plane-stress body itself
// (Saint-Venant-Kirchhoff). None of it shares code with the solid.
//
// usage: beam_reference [THICKNESS/LENGTH [F L^2/(E I) [ELEMENTS ALONG [ACROSS]]]]
#include <Eigen/SparseCholesky>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {

constexpr double kPoisson = 0.3;  // Young's modulus and length are 1

struct Tip {
  double across, along;  // displacement over the length
};

/// Shooting with Runge and Kutta's method; without shear and stretch, the elastica.
Tip beam(double thickness, double load, bool shears) {
  const double bending = std::pow(thickness, 3) / 12, force = load * bending, stretching = thickness,
               shearing = 5.0 / 6.0 * 0.5 / (1 + kPoisson) * thickness;
  using State = std::array<double, 4>;  // x, y, rotation, moment
  const auto slope = [&](const State& s) {
    const double c = std::cos(s[2]), d = std::sin(s[2]);
    const double stretch = 1 + (shears ? force * d / stretching : 0),
                 shear = shears ? force * c / shearing : 0;
    const double x = stretch * c - shear * d;
    return State{x, stretch * d + shear * c, s[3] / bending, -x * force};
  };
  const auto shoot = [&](double moment) {
    constexpr int kSteps = 4000;
    State s{0, 0, 0, moment};
    const auto moved = [&](const State& k, double h) {
      State t = s;
      for (std::size_t c = 0; c < 4; ++c) t[c] += h * k[c];
      return t;
    };
    for (int step = 0; step < kSteps; ++step) {
      constexpr double h = 1.0 / kSteps;
      const State a = slope(s), b = slope(moved(a, 0.5 * h)), c = slope(moved(b, 0.5 * h)),
                  d = slope(moved(c, h));
      for (std::size_t k = 0; k < 4; ++k) s[k] += h / 6 * (a[k] + 2 * b[k] + 2 * c[k] + d[k]);
    }
    return s;
  };
  double low = 0, high = 2 * force;
  for (int bisection = 0; bisection < 100; ++bisection) {
    const double middle = 0.5 * (low + high);
    (shoot(middle)[3] > 0 ? high : low) = middle;
  }
  const State end = shoot(low);
  return {end[1], end[0] - 1};
}

/// Newton's method with twenty load steps; the mesh is finer towards the clamp.
Tip finite_elements(double thickness, double load, int along, int across) {
  const int columns = 2 * along + 1, rows = 2 * across + 1;
  const auto node = [&](int i, int j) { return i * rows + j; };
  const auto place = [&](double s) { return (s + 3 * s * s) / 4; };
  std::vector<double> x(static_cast<std::size_t>(columns));
  for (int i = 0; i < columns; ++i) {
    const double from = place(static_cast<double>(i / 2 * 2) / (columns - 1)),
                 to = i % 2 == 0 ? from : place(static_cast<double>(i / 2 * 2 + 2) / (columns - 1));
    x[static_cast<std::size_t>(i)] = 0.5 * (from + to);
  }
  const double c11 = 1 / (1 - kPoisson * kPoisson), c12 = kPoisson * c11, g = 0.5 / (1 + kPoisson);
  const Eigen::Matrix3d law = (Eigen::Matrix3d() << c11, c12, 0, c12, c11, 0, 0, 0, g).finished();
  const std::array<double, 3> gauss{-std::sqrt(0.6), 0, std::sqrt(0.6)}, weight{5.0 / 9, 8.0 / 9, 5.0 / 9};
  const int size = 2 * columns * rows;
  const double force = load * std::pow(thickness, 3) / 12, height = thickness / across;
  Eigen::VectorXd u = Eigen::VectorXd::Zero(size);
  for (int step = 1; step <= 20; ++step)
    for (int iteration = 0; iteration < 30; ++iteration) {
      Eigen::VectorXd residual = Eigen::VectorXd::Zero(size);
      std::vector<Eigen::Triplet<double>> entries;
      for (int j = 0; j < across; ++j)
        for (int b = 0; b < 3; ++b)
          residual[2 * node(columns - 1, 2 * j + b) + 1] +=
              force * step / 20 / across * (b == 1 ? 4.0 : 1.0) / 6;
      for (int ei = 0; ei < along; ++ei)
        for (int ej = 0; ej < across; ++ej) {
          std::array<int, 9> nodes{};
          for (int k = 0; k < 9; ++k)
            nodes[static_cast<std::size_t>(k)] = node(2 * ei + k / 3, 2 * ej + k % 3);
          const double width = x[static_cast<std::size_t>(2 * ei + 2)] - x[static_cast<std::size_t>(2 * ei)];
          Eigen::Matrix<double, 18, 18> stiffness = Eigen::Matrix<double, 18, 18>::Zero();
          Eigen::Matrix<double, 18, 1> internal = Eigen::Matrix<double, 18, 1>::Zero();
          for (int point = 0; point < 9; ++point) {
            const auto shape = [&](std::size_t p, int k, bool derivative) {
              const double t = gauss[p];
              if (derivative) return k == 0 ? t - 0.5 : k == 1 ? -2 * t : t + 0.5;
              return k == 0 ? 0.5 * t * (t - 1) : k == 1 ? 1 - t * t : 0.5 * t * (t + 1);
            };
            const auto p = static_cast<std::size_t>(point / 3), q = static_cast<std::size_t>(point % 3);
            const double volume = weight[p] * weight[q] * width * height / 4;
            Eigen::Matrix<double, 9, 2> slope;
            Eigen::Matrix2d f = Eigen::Matrix2d::Identity();
            for (int k = 0; k < 9; ++k) {
              slope(k, 0) = 2 / width * shape(p, k / 3, true) * shape(q, k % 3, false);
              slope(k, 1) = 2 / height * shape(p, k / 3, false) * shape(q, k % 3, true);
              f += Eigen::Vector2d(u.segment<2>(2 * nodes[static_cast<std::size_t>(k)])) * slope.row(k);
            }
            const Eigen::Matrix2d strain = 0.5 * (f.transpose() * f - Eigen::Matrix2d::Identity());
            const Eigen::Vector3d stress =
                law * Eigen::Vector3d(strain(0, 0), strain(1, 1), 2 * strain(0, 1));
            const Eigen::Matrix2d s =
                (Eigen::Matrix2d() << stress[0], stress[2], stress[2], stress[1]).finished();
            Eigen::Matrix<double, 3, 18> b;
            for (int k = 0; k < 9; ++k)
              for (int c = 0; c < 2; ++c) {
                b(0, 2 * k + c) = f(c, 0) * slope(k, 0);
                b(1, 2 * k + c) = f(c, 1) * slope(k, 1);
                b(2, 2 * k + c) = f(c, 0) * slope(k, 1) + f(c, 1) * slope(k, 0);
              }
            stiffness += volume * b.transpose() * law * b;
            internal += volume * b.transpose() * stress;
            const Eigen::Matrix<double, 9, 9> geometric = volume * slope * s * slope.transpose();
            for (int k = 0; k < 9; ++k)
              for (int l = 0; l < 9; ++l)
                for (int c = 0; c < 2; ++c) stiffness(2 * k + c, 2 * l + c) += geometric(k, l);
          }
          const auto global = [&](int k) { return 2 * nodes[static_cast<std::size_t>(k / 2)] + k % 2; };
          for (int k = 0; k < 18; ++k) {
            residual[global(k)] -= internal[k];
            for (int l = 0; l < 18; ++l) entries.emplace_back(global(k), global(l), stiffness(k, l));
          }
        }
      for (int c = 0; c < 2 * rows; ++c) {
        residual[c] = 0;
        entries.emplace_back(c, c, 1e12);  // the clamp
      }
      Eigen::SparseMatrix<double> matrix(size, size);
      matrix.setFromTriplets(entries.begin(), entries.end());
      const Eigen::VectorXd change =
          Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(matrix).solve(residual);
      u += change;
      if (change.norm() < 1e-10 * u.norm()) break;
    }
  const int tip = 2 * node(columns - 1, across);
  return {u[tip + 1], u[tip]};
}

}  // namespace

int main(int count, char** words) {
  const auto number = [&](int k, double otherwise) { return count > k ? std::atof(words[k]) : otherwise; };
  const double thickness = number(1, 0.1), load = number(2, 10);
  const int along = static_cast<int>(number(3, 60)), across = static_cast<int>(number(4, 6));
  const auto print = [](const char* name, const Tip& tip) {
    std::printf("%-32s across %.6f  along %.6f\n", name, tip.across, tip.along);
  };
  print("elastica", beam(thickness, load, false));
  print("Reissner's beam", beam(thickness, load, true));
  print("finite elements, Q9", finite_elements(thickness, load, along, across));
}
