// Sparse linear systems, with the library that solves them kept behind a plain interface: its templates are
// compiled once, here, and no other file of the room sees them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace estuary::solid {

/// Square matrix in compressed columns: those of column c are first[c] .. first[c + 1] - 1, rows ascending.
struct SparseMatrix {
  std::vector<std::int32_t> first{0};
  std::vector<std::int32_t> row;
  std::vector<double> value;

  [[nodiscard]] std::size_t columns() const { return first.size() - 1; }
};

struct SparseEntry {
  std::int32_t row = 0, column = 0;
  double value = 0;
};

/// Entries at one place add up, in the order given.
SparseMatrix assemble_sparse(std::size_t columns, std::span<const SparseEntry> entries);

class SparseSolver {
public:
  enum class Kind {
    symmetric,  // L D L^T without pivoting; reads the lower half
    general     // L U with partial pivoting
  };
  /// `shift` is added to the diagonal of symmetric systems.
  explicit SparseSolver(Kind kind, double shift = 0);
  ~SparseSolver();
  SparseSolver(const SparseSolver&) = delete;
  SparseSolver& operator=(const SparseSolver&) = delete;

  /// False when the matrix is singular. The pattern has to be that of the first call.
  bool factorise(const SparseMatrix& matrix);
  /// Solves for `right_hand_side`; false when the solution is not finite.
  bool solve(std::span<const double> right_hand_side, std::vector<double>& solution) const;
  /// Of the matrix last factorised: all entries of D are positive (symmetric systems only).
  [[nodiscard]] bool positive_definite() const;

private:
  struct Factors;
  std::unique_ptr<Factors> factors_;
};

}  // namespace estuary::solid
