// Acceleration of the fixed-point iteration x = H(x): from an iterate and its residual r = H(x) - x to the
// next iterate. Pure objects: no participant, no file, no clock; safe on zero residuals.
#pragma once

#include <deque>
#include <memory>
#include <span>
#include <vector>

namespace estuary::coupler {

enum class AccelerationKind;

class Acceleration {
public:
  Acceleration() = default;
  Acceleration(const Acceleration&) = delete;
  Acceleration& operator=(const Acceleration&) = delete;
  Acceleration(Acceleration&&) = delete;
  Acceleration& operator=(Acceleration&&) = delete;
  virtual ~Acceleration() = default;

  /// Overwrites `iterate` with the next one. Both have the same length in every call of one window.
  virtual void update(std::span<const double> residual, std::span<double> iterate) = 0;
  /// A new window begins: forget what holds for one window only.
  virtual void begin_window() {}
  /// The factor applied to the last residual, for the log.
  [[nodiscard]] virtual double relaxation() const = 0;
};

/// x <- x + omega r. omega = 1: no relaxation.
class ConstantRelaxation final : public Acceleration {
public:
  explicit ConstantRelaxation(double omega) : omega_(omega) {}
  void update(std::span<const double> residual, std::span<double> iterate) override;
  [[nodiscard]] double relaxation() const override { return omega_; }

private:
  double omega_;
};

/// Aitken's dynamic relaxation for vectors (Irons & Tuck 1969; Kuettler & Wall 2008, eq. 44):
///   omega_{k+1} = -omega_k  r_k . (r_{k+1} - r_k) / |r_{k+1} - r_k|^2.
/// The first iteration of a window uses the last factor of the window before, held to the initial factor in
/// size. A residual that did not change, or a factor that is not finite, keeps the factor; its size is
/// bounded by `largest`.
class AitkenRelaxation final : public Acceleration {
public:
  explicit AitkenRelaxation(double initial, double largest = 2.0);
  void update(std::span<const double> residual, std::span<double> iterate) override;
  void begin_window() override;
  [[nodiscard]] double relaxation() const override { return omega_; }

private:
  double initial_;
  double largest_;
  double omega_;
  std::vector<double> last_residual_;  // empty at a window's start
};

/// Interface quasi-Newton method with the inverse Jacobian from a least-squares problem (Degroote, Bathe &
/// Vierendeels 2009): x <- x + r + W c, where c minimises |V c + r| and the columns of V and W are the
/// differences of residuals and of answers H(x) between iterations, newest first. Columns of the last
/// `windows_reused` windows are kept. A column whose part independent of the newer ones is smaller than
/// `filter_limit` times itself is dropped (QR2 filter, Haelterman et al. 2016). Without a column the residual
/// is relaxed by `initial`.
class InterfaceQuasiNewton final : public Acceleration {
public:
  InterfaceQuasiNewton(double initial, std::size_t windows_reused, std::size_t most_columns = 100,
                       double filter_limit = 1e-2);
  void update(std::span<const double> residual, std::span<double> iterate) override;
  void begin_window() override;
  /// The initial factor while there is no column, else 1: the step is a whole quasi-Newton step.
  [[nodiscard]] double relaxation() const override { return factor_; }
  [[nodiscard]] std::size_t columns() const { return residual_changes_.size(); }

private:
  double initial_;
  double factor_;
  std::size_t windows_reused_;
  std::size_t most_columns_;
  double filter_limit_;
  // Newest first.
  std::deque<std::vector<double>> residual_changes_;
  std::deque<std::vector<double>> answer_changes_;
  std::deque<std::size_t> columns_of_window_;  // this window's first
  std::vector<double> last_residual_;
  std::vector<double> last_answer_;
};

struct AccelerationSettings {
  AccelerationKind kind;
  double relaxation = 0.5;
  std::size_t windows_reused = 0;
};
std::unique_ptr<Acceleration> make_acceleration(const AccelerationSettings& settings);

}  // namespace estuary::coupler
