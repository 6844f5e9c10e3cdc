#include "sparse_solver.hpp"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

using Matrix = Eigen::SparseMatrix<double>;

Eigen::Map<const Matrix> view(const SparseMatrix& matrix) {
  const auto n = static_cast<Eigen::Index>(matrix.columns());
  return {n,
          n,
          static_cast<Eigen::Index>(matrix.value.size()),
          matrix.first.data(),
          matrix.row.data(),
          matrix.value.data()};
}

}  // namespace

struct SparseSolver::Factors {
  Kind kind = Kind::symmetric;
  bool analysed = false;
  Eigen::SimplicialLDLT<Matrix> symmetric;
  Eigen::SparseLU<Matrix> general;
};

SparseSolver::SparseSolver(Kind kind, double shift) : factors_(std::make_unique<Factors>()) {
  factors_->kind = kind;
  if (shift != 0) factors_->symmetric.setShift(shift);
}
SparseSolver::~SparseSolver() = default;

bool SparseSolver::factorise(const SparseMatrix& matrix) {
  const Matrix a = view(matrix);
  Factors& f = *factors_;
  if (f.kind == Kind::symmetric) {
    if (!f.analysed) f.symmetric.analyzePattern(a);
    f.analysed = true;
    f.symmetric.factorize(a);
    return f.symmetric.info() == Eigen::Success;
  }
  if (!f.analysed) f.general.analyzePattern(a);
  f.analysed = true;
  f.general.factorize(a);
  return f.general.info() == Eigen::Success;
}

bool SparseSolver::solve(std::span<const double> right_hand_side, std::vector<double>& solution) const {
  const auto n = static_cast<Eigen::Index>(right_hand_side.size());
  const Eigen::Map<const Eigen::VectorXd> b(right_hand_side.data(), n);
  const Eigen::VectorXd x = factors_->kind == Kind::symmetric ? factors_->symmetric.solve(b).eval()
                                                              : factors_->general.solve(b).eval();
  solution.assign(x.data(), x.data() + x.size());
  return std::all_of(solution.begin(), solution.end(), [](double v) { return std::isfinite(v); });
}

bool SparseSolver::positive_definite() const {
  return factors_->kind == Kind::symmetric && (factors_->symmetric.vectorD().array() > 0).all();
}

}  // namespace estuary::solid
