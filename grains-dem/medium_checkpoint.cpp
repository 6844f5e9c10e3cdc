#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "checkpoint.hpp"
#include "granular_medium.hpp"

namespace estuary::grains {

template <int D>
void GranularMedium<D>::save(const std::filesystem::path& file) const {
  const State<D>& state = dynamics_->state();
  CheckpointWriter writer(file);
  const auto add_numbers = [&](const char* name, const auto& values) {
    const std::vector<double> numbers(values.begin(), values.end());
    writer.add(name, numbers);
  };
  writer.add("grains", static_cast<std::uint64_t>(state.size()));
  writer.add("pairs", static_cast<std::uint64_t>(state.partner.size()));
  writer.add("bonds", static_cast<std::uint64_t>(dynamics_->bonds().size()));
  writer.add("position", state.position);
  writer.add("velocity", state.velocity);
  writer.add("spin", state.spin);
  writer.add("force", state.force);
  writer.add("torque", state.torque);
  writer.add("external_force", state.external_force);
  writer.add("external_torque", state.external_torque);
  writer.add("radius", state.radius);
  writer.add("inverse_mass", state.inverse_mass);
  writer.add("inverse_inertia", state.inverse_inertia);
  writer.add("wrapped", state.wrapped);
  writer.add("reference_position", state.reference_position);
  writer.add("root_mass", state.root_mass);
  writer.add("history", state.history);
  writer.add("wall_history", state.wall_history);
  writer.add("wall_travel", state.wall_travel);
  add_numbers("identity", state.identity);
  add_numbers("row_start", state.row_start);
  add_numbers("partner", state.partner);
  writer.add("image", state.image);
  std::vector<double> wall_contact;
  for (const WallContact& contact : state.wall_contact)
    wall_contact.insert(wall_contact.end(),
                        {static_cast<double>(contact.grain), static_cast<double>(contact.wall),
                         static_cast<double>(contact.element), static_cast<double>(contact.near_begin),
                         static_cast<double>(contact.near_end)});
  writer.add("wall_contact", wall_contact);
  add_numbers("wall_facet", state.wall_facet);
  for (std::size_t w = 0; w < dynamics_->walls().size(); ++w) {
    writer.add(fmt::format("wall_{}_point", w), dynamics_->walls()[w].point);
    writer.add(fmt::format("wall_{}_pivot", w), dynamics_->walls()[w].pivot);
    writer.add(fmt::format("wall_{}_node", w), dynamics_->walls()[w].node);
  }
  const Bonds<D>& bonds = dynamics_->bonds();
  add_numbers("bond_first", bonds.first);
  add_numbers("bond_second", bonds.second);
  writer.add("bond_length", bonds.length);
  writer.add("bond_shear", bonds.shear);
  writer.add("bond_turn", bonds.turn);
  writer.add("bond_broken", bonds.broken);
  const std::array<double, 10> numbers{
      state.time,         state.ledger.normal, state.ledger.tangential, state.ledger.rolling,
      state.ledger.given, state.external_work, state.bond_loss,         dynamics_->energy_at_start(),
      state.wall_moved,   first_contact_};
  writer.add("numbers", numbers);
  const typename Dynamics<D>::Snapshot snapshot = dynamics_->snapshot();
  writer.add("gear_terms", static_cast<std::uint64_t>(snapshot.gear_position.size()));
  for (std::size_t k = 0; k < snapshot.gear_position.size(); ++k) {
    writer.add(fmt::format("gear_position_{}", k), snapshot.gear_position[k]);
    writer.add(fmt::format("gear_angle_{}", k), snapshot.gear_angle[k]);
  }
  if (!virtual_mass_.empty()) {
    writer.add("acceleration", accelerations_.last);
    writer.add("expected_acceleration", accelerations_.expected);
    writer.add("turning", accelerations_.last_turning);
    writer.add("expected_turning", accelerations_.expected_turning);
  }
  if (scene_.fluid.lead > 0) {
    writer.add("last_forces", static_cast<std::uint64_t>(last_force_.size()));
    if (!last_force_.empty()) writer.add("last_force", last_force_);
  }
  writer.commit();
}

template <int D>
void GranularMedium<D>::load(const std::filesystem::path& file) {
  const CheckpointReader reader(file);
  typename Dynamics<D>::Snapshot snapshot = dynamics_->snapshot();
  State<D>& state = snapshot.state;
  const std::size_t n = state.size();
  if (reader.read_count("grains") != n || reader.read_count("bonds") != snapshot.bonds.size())
    throw std::runtime_error(fmt::format("{} belongs to another sample: {} grains there, {} here",
                                         file.string(), reader.read_count("grains"), n));
  const auto finite = [&](const std::vector<double>& values) {
    for (const double value : values)
      if (!std::isfinite(value))
        throw std::runtime_error(file.string() + " holds a value that is not finite");
  };
  const auto whole = [&](const char* name, std::vector<std::uint32_t>& values, std::size_t size,
                         double limit) {
    const std::vector<double> numbers = reader.read_all(name);
    if (numbers.size() != size)
      throw std::runtime_error(fmt::format("{}: '{}' has a wrong length", file.string(), name));
    values.clear();
    for (const double number : numbers) {
      if (!(number >= 0 && number <= limit))
        throw std::runtime_error(fmt::format("{}: '{}' holds {}", file.string(), name, number));
      values.push_back(static_cast<std::uint32_t>(number));
    }
  };
  for (auto [name, values] : std::initializer_list<std::pair<const char*, std::vector<double>*>>{
           {"position", &state.position},
           {"velocity", &state.velocity},
           {"spin", &state.spin},
           {"force", &state.force},
           {"torque", &state.torque},
           {"external_force", &state.external_force},
           {"external_torque", &state.external_torque},
           {"radius", &state.radius},
           {"inverse_mass", &state.inverse_mass},
           {"inverse_inertia", &state.inverse_inertia},
           {"wrapped", &state.wrapped},
           {"reference_position", &state.reference_position},
           {"wall_travel", &state.wall_travel}}) {
    reader.read(name, *values);
    finite(*values);
  }
  const std::size_t pairs = reader.read_count("pairs");
  const std::size_t former_pairs = state.partner.size();
  const std::size_t memory = history_size_of<D>(scene_.law);
  (void)former_pairs;
  const double last_grain = static_cast<double>(n) - 1;
  whole("identity", state.identity, n, last_grain);
  whole("row_start", state.row_start, n + 1, static_cast<double>(pairs));
  whole("partner", state.partner, pairs, last_grain);
  state.image.resize(pairs);
  reader.read("image", state.image);
  for (const auto image : state.image)
    if (image >= kImages<D>) throw std::runtime_error(file.string() + " names an image that there is not");
  state.root_mass.resize(pairs);
  reader.read("root_mass", state.root_mass);
  state.history.resize(memory * pairs + 8);
  reader.read("history", state.history);
  finite(state.history);
  if (!std::is_sorted(state.row_start.begin(), state.row_start.end()) || state.row_start.back() != pairs)
    throw std::runtime_error(file.string() + ": the pair list is broken");
  const std::vector<double> wall_contact = reader.read_all("wall_contact");
  const std::size_t near = reader.read_all("wall_facet").size();
  std::size_t most_facets = 0;
  for (const Wall<D>& wall : snapshot.walls) most_facets = std::max(most_facets, wall.facets());
  whole("wall_facet", state.wall_facet, near, static_cast<double>(most_facets));
  state.wall_contact.clear();
  for (std::size_t k = 0; k + 4 < wall_contact.size(); k += 5) {
    const auto number = [&](std::size_t at) { return static_cast<std::uint32_t>(wall_contact[k + at]); };
    const WallContact contact{number(0), number(1), number(2), number(3), number(4)};
    if (contact.grain >= n || contact.wall >= snapshot.walls.size() ||
        contact.near_begin > contact.near_end || contact.near_end > near)
      throw std::runtime_error(file.string() + " names a grain, wall or facet that there is not");
    for (std::uint32_t m = contact.near_begin; m < contact.near_end; ++m)
      if (state.wall_facet[m] >= snapshot.walls[contact.wall].facets())
        throw std::runtime_error(file.string() + " names a facet that there is not");
    state.wall_contact.push_back(contact);
  }
  state.wall_history.resize(memory * state.wall_contact.size() + 8);
  reader.read("wall_history", state.wall_history);
  for (std::size_t w = 0; w < snapshot.walls.size(); ++w) {
    reader.read(fmt::format("wall_{}_point", w), snapshot.walls[w].point);
    reader.read(fmt::format("wall_{}_pivot", w), snapshot.walls[w].pivot);
    reader.read(fmt::format("wall_{}_node", w), snapshot.walls[w].node);
  }
  Bonds<D>& bonds = snapshot.bonds;
  whole("bond_first", bonds.first, bonds.size(), last_grain);
  whole("bond_second", bonds.second, bonds.size(), last_grain);
  reader.read("bond_length", bonds.length);
  reader.read("bond_shear", bonds.shear);
  reader.read("bond_turn", bonds.turn);
  reader.read("bond_broken", bonds.broken);
  std::array<double, 10> numbers{};
  reader.read("numbers", numbers);
  if (!virtual_mass_.empty()) {
    for (auto [name, values] : std::initializer_list<std::pair<const char*, std::vector<double>*>>{
             {"acceleration", &accelerations_.last},
             {"expected_acceleration", &accelerations_.expected},
             {"turning", &accelerations_.last_turning},
             {"expected_turning", &accelerations_.expected_turning}}) {
      reader.read(name, *values);
      finite(*values);
    }
  }
  if (scene_.fluid.lead > 0) {
    const std::size_t count = reader.read_count("last_forces");
    if (count != 0 && count != D * mass_.size())
      throw std::runtime_error(fmt::format("{} holds {} components of the fluid's last forces, not {}",
                                           file.string(), count, D * mass_.size()));
    last_force_.resize(count);
    if (count != 0) {
      reader.read("last_force", last_force_);
      finite(last_force_);
    }
  }
  state.time = numbers[0];
  state.ledger = {numbers[1], numbers[2], numbers[3], numbers[4]};
  state.external_work = numbers[5];
  state.bond_loss = numbers[6];
  state.wall_moved = numbers[8];
  first_contact_ = numbers[9];
  const std::size_t gear_terms = reader.read_count("gear_terms");
  if (gear_terms > 16) throw std::runtime_error(file.string() + " holds too many derivatives");
  snapshot.gear_position.assign(gear_terms, std::vector<double>(state.velocity.size()));
  snapshot.gear_angle.assign(gear_terms, std::vector<double>(state.spin.size()));
  for (std::size_t k = 0; k < gear_terms; ++k) {
    reader.read(fmt::format("gear_position_{}", k), snapshot.gear_position[k]);
    reader.read(fmt::format("gear_angle_{}", k), snapshot.gear_angle[k]);
  }
  dynamics_->restore(snapshot);
  dynamics_->set_energy_at_start(numbers[7]);
}

#define ESTUARY_CHECKPOINT(D)                                                \
  template void GranularMedium<D>::save(const std::filesystem::path&) const; \
  template void GranularMedium<D>::load(const std::filesystem::path&);
ESTUARY_CHECKPOINT(2)
ESTUARY_CHECKPOINT(3)
#undef ESTUARY_CHECKPOINT

}  // namespace estuary::grains
