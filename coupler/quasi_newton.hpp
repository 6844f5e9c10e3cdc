// Interface quasi-Newton acceleration: learns from the iterations how the answer H(x) follows x.
//
// With the residual r = H(x) - x, every iteration gives a column of V (change of r) and of W (change of
// H(x)). The next iterate is H(x) + W c, where V c cancels r as well as it can (Degroote, Bathe & Vierendeels
// 2009). Names and meaning of the options are those of preCICE.
#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <deque>
#include <span>
#include <vector>

#include "acceleration.hpp"
#include "reading_team.hpp"

namespace estuary::coupler {

struct QuasiNewtonSettings {
  double relaxation = 0.5;         // of the first iteration, when nothing has been learnt
  std::size_t windows_reused = 8;  // past windows whose columns are kept
  std::size_t most_columns = 100;  // of one least-squares problem
  ColumnFilter filter = ColumnFilter::qr2;
  double filter_limit = 1e-2;
  /// Factor of the part of the residual that the columns cannot represent. Below 1 for problems whose plain
  /// iteration must not be followed even once.
  double remainder = 1.0;
  /// Lengths of the fields that make up the iterate, for the residual-sum preconditioner: each field is
  /// divided by the sum over the window's iterations of its share of the residual's norm. Empty: no
  /// preconditioner.
  std::vector<std::size_t> fields;
  /// That read the columns of large wet surfaces (see `ReadingTeam`); the same bits with any number.
  int threads = 0;
};

/// Weights of the fields from their residuals so far in this window.
class ResidualSum {
public:
  explicit ResidualSum(std::vector<std::size_t> fields);
  void begin_window();
  void add(std::span<const double> residual);
  void set_weights(std::vector<double> weights) { weights_ = std::move(weights); }
  [[nodiscard]] const std::vector<double>& weights() const { return weights_; }
  [[nodiscard]] const std::vector<std::size_t>& fields() const { return fields_; }

private:
  std::vector<std::size_t> fields_;
  std::vector<double> sums_;
  std::vector<double> weights_;
};

/// Columns of V and W, newest first, and the least-squares problem over them. Products of columns are kept,
/// field by field, so that a new column and the right-hand side cost one pass over the others and new weights
/// cost nothing. The normal equations are safe here because the filter bounds their condition.
class ColumnPairs {
public:
  explicit ColumnPairs(std::vector<std::size_t> fields) : fields_(std::move(fields)) {}

  /// `right` is what the next call of `apply` will be given.
  void push_front(std::vector<double> residual_change, std::vector<double> answer_change,
                  std::span<const double> right, ReadingTeam& team);
  /// Drops the oldest. `spare` is given their memory.
  void resize(std::size_t count, std::vector<std::vector<double>>& spare);
  [[nodiscard]] std::size_t count() const { return pairs_.size(); }
  [[nodiscard]] const std::vector<std::size_t>& fields() const { return fields_; }

  /// Whether somebody looks at what a problem leaves of `right`.
  enum class Rest { needed, unused };
  /// Finds c that minimises |V c - right| with the weights, adds W c to `answer` and, where the rest is
  /// needed, subtracts V c from `right`. Columns below `smallest` in norm and those the filter drops take no
  /// part. Returns how many did.
  std::size_t apply(std::span<double> right, std::span<double> answer, const std::vector<double>& weights,
                    const QuasiNewtonSettings& settings, double smallest, Rest rest, ReadingTeam& team);

  void save(StateWriter& state) const;
  void load(StateReader& state);

private:
  struct Pair {
    std::vector<double> residual_change;
    std::vector<double> answer_change;
    // Product with every older pair and itself, newest of them first; per field.
    std::deque<std::vector<double>> products;
    std::vector<double> projection;  // product with the right-hand side; per field
  };
  template <std::size_t Count>
  void multiply(const std::vector<double>& column, const std::array<std::span<const double>, Count>& others,
                const std::array<std::vector<double>*, Count>& products) const;
  void project(std::span<const double> right, ReadingTeam& team);
  void add_columns(const std::vector<std::size_t>& chosen, const Eigen::VectorXd& factors,
                   std::vector<double> Pair::*column, std::span<double> sum, ReadingTeam& team) const;
  [[nodiscard]] double product(std::size_t newer, std::size_t older,
                               const std::vector<double>& weights) const;
  [[nodiscard]] std::vector<std::size_t> choose(const QuasiNewtonSettings& settings,
                                                const std::vector<double>& weights, double smallest,
                                                ColumnFilter filter, Eigen::MatrixXd& triangle) const;

  std::vector<std::size_t> fields_;
  std::deque<Pair> pairs_;
  bool projected_ = false;  // the projections are those of what comes next
};

/// What both methods do in an iteration: add the new columns to the first least-squares problem, then let
/// each problem take its part of what the ones before it left of the residual.
class QuasiNewton : public Acceleration {
public:
  explicit QuasiNewton(QuasiNewtonSettings settings);
  void update(std::span<const double> residual, std::span<double> iterate) final;
  void begin_window() override;
  void forget() override;
  /// The initial factor while there is no column, else 1: the step is a whole quasi-Newton step.
  [[nodiscard]] double relaxation() const final { return factor_; }
  [[nodiscard]] std::size_t columns() const { return columns_used_; }
  void save(StateWriter& state) const override;
  void load(StateReader& state) override;

protected:
  QuasiNewtonSettings settings_;
  std::deque<ColumnPairs> problems_;        // newest first
  std::vector<std::vector<double>> spare_;  // memory of columns that were dropped

private:
  double factor_;
  std::size_t columns_used_ = 0;
  ReadingTeam team_;
  ResidualSum weights_;
  std::vector<double> last_residual_;
  std::vector<double> last_answer_;
  std::vector<double> answer_, right_;  // of the iteration under way
};

/// IQN-ILS: one least-squares problem over the columns of this window and of the last `windows_reused`.
class InterfaceQuasiNewton final : public QuasiNewton {
public:
  using QuasiNewton::QuasiNewton;
  void begin_window() override;
  void forget() override;
  void save(StateWriter& state) const override;
  void load(StateReader& state) override;

private:
  std::deque<std::size_t> columns_of_window_;  // of past windows, newest first
};

/// IQN-IMVJ (Bogaers et al. 2014): this window's columns first, then what they leave of the residual goes to
/// the window before, and so on. That is the inverse Jacobian J_n = W_n V_n^+ + J_(n-1) (1 - V_n V_n^+)
/// applied without ever forming it; windows older than `windows_reused` are dropped.
class MultiVectorQuasiNewton final : public QuasiNewton {
public:
  using QuasiNewton::QuasiNewton;
  void begin_window() override;
};

}  // namespace estuary::coupler
