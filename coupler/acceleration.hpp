// Acceleration of the fixed-point iteration x = H(x): from an iterate and its residual r = H(x) - x to the
// next iterate. Pure objects: no participant, no file, no clock; safe on zero residuals.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "state_numbers.hpp"

namespace estuary::coupler {

enum class AccelerationKind { none, constant, aitken, iqn_ils, iqn_imvj };

/// When a column of the quasi-Newton methods counts as dependent on newer ones; `limit` is the threshold.
///   qr1  its independent part is below limit times the norm of the whole triangular factor
///   qr2  its independent part is below limit times the column itself (Haelterman et al. 2016)
///   qr3  qr2, once qr1 finds a column to drop
enum class ColumnFilter { none, qr1, qr2, qr3 };

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
  /// Forget everything but the settings: what was learnt led astray.
  virtual void forget() = 0;
  /// The factor applied to the last residual, for the log.
  [[nodiscard]] virtual double relaxation() const = 0;
  /// What was learnt, between two windows, so that an object of the same settings goes on bit for bit.
  virtual void save(StateWriter& state) const = 0;
  virtual void load(StateReader& state) = 0;
};

/// x <- x + factor r.
void relax(double factor, std::span<const double> residual, std::span<double> iterate);

/// x <- x + omega r. omega = 1: no relaxation.
class ConstantRelaxation final : public Acceleration {
public:
  explicit ConstantRelaxation(double omega) : omega_(omega) {}
  void update(std::span<const double> residual, std::span<double> iterate) override;
  void forget() override {}
  [[nodiscard]] double relaxation() const override { return omega_; }
  void save(StateWriter& /*state*/) const override {}
  void load(StateReader& /*state*/) override {}

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
  void forget() override;
  [[nodiscard]] double relaxation() const override { return omega_; }
  void save(StateWriter& state) const override { state.number(omega_); }
  void load(StateReader& state) override { omega_ = state.number(); }

private:
  double initial_;
  double largest_;
  double omega_;
  std::vector<double> last_residual_;  // empty at a window's start
};

struct AccelerationSettings {
  AccelerationKind kind;
  double relaxation = 0.5;
  std::size_t windows_reused = 0;
  std::size_t most_columns = 100;
  ColumnFilter filter = ColumnFilter::qr2;
  double filter_limit = 1e-2;
  double remainder = 1.0;
  std::vector<std::size_t> fields;  // for the residual-sum preconditioner; empty without
};
std::unique_ptr<Acceleration> make_acceleration(const AccelerationSettings& settings);

}  // namespace estuary::coupler
