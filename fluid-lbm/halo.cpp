#include "halo.hpp"

#include <cstring>

namespace estuary::fluid {

Halo::Halo(Ranks& ranks, const Grid& grid) : ranks_(ranks) {
  const LatticeTable lattice = lattice_of_dimension(grid.dimension());
  const std::size_t axis = grid.nz > 0 ? 2 : 1;
  for (int i = 0; i < lattice.count; ++i) {
    const int along = lattice.velocity[i][axis];
    if (along != 0) crossing_[along > 0 ? 1 : 0].push_back(i);
    all_.push_back(i);
  }
  for (const int side : {0, 1}) {
    End& end = ends_[static_cast<std::size_t>(side)];
    end.towards = side == 0 ? -1 : 1;
    end.inner = side == 0 ? grid.first_layer() : grid.past_layer() - 1;
    end.outer = end.inner + end.towards;
    const int neighbour = grid.rank + end.towards;
    end.across_period = neighbour < 0 || neighbour == grid.ranks;
    if (!end.across_period) {
      end.partner = neighbour;
    } else if (grid.periodic_slabs()) {
      end.partner = neighbour < 0 ? grid.ranks - 1 : 0;
    }
  }
}

void Halo::exchange(Populations& populations, Parity parity, bool everything) {
  if (parity == Parity::odd) {
    take_back(populations, !complete_, true);
  } else {
    if (!complete_) take_back(populations, true, false);
    if (!everything) give(populations, true, true, false);
  }
  complete_ = true;
}

void Halo::tell_of_rules(Populations& populations, Parity parity) {
  if (parity == Parity::odd) {
    give(populations, true, false, false);
  } else {
    take_back(populations, true, false);
  }
  complete_ = true;
}

void Halo::look_around(Populations& populations, Parity parity) {
  if (parity == Parity::odd) {
    take_back(populations, !complete_, true);
  } else if (!complete_) {
    take_back(populations, true, false);
  }
  complete_ = true;
  give_everything(populations);
}

void Halo::pack(Populations& populations, const Part& part, std::vector<std::byte>& bytes) {
  const auto values = static_cast<std::size_t>(part.layers * populations.layer_size());
  populations.visit([&](const auto* f) {
    const std::size_t size = values * sizeof *f;
    bytes.resize(part.populations.size() * size);
    for (std::size_t n = 0; n < part.populations.size(); ++n) {
      const std::ptrdiff_t from =
          part.populations[n] * populations.plane() + populations.layer_start(part.first_layer);
      std::memcpy(bytes.data() + n * size, f + from, size);
    }
  });
}

void Halo::unpack(Populations& populations, const Part& part, const std::vector<std::byte>& bytes) {
  const auto values = static_cast<std::size_t>(part.layers * populations.layer_size());
  populations.visit([&](auto* f) {
    const std::size_t size = values * sizeof *f;
    for (std::size_t n = 0; n < part.populations.size(); ++n) {
      const std::ptrdiff_t to =
          part.populations[n] * populations.plane() + populations.layer_start(part.first_layer);
      std::memcpy(f + to, bytes.data() + n * size, size);
    }
  });
}

// `parts` says of an end what goes out there and what comes in.
template <class Parts>
void Halo::transfer(Populations& populations, bool between_slabs, bool across_period, const Parts& parts) {
  std::array<Ranks::Message, 2> outgoing;
  std::array<Ranks::Message, 2> incoming;
  std::array<End*, 2> taking_part{};
  std::size_t count = 0;
  for (End& end : ends_) {
    if (end.partner < 0 || !(end.across_period ? across_period : between_slabs)) continue;
    const auto [out, in] = parts(end);
    pack(populations, out, end.outgoing);
    const std::size_t value =
        populations.storage() == Storage::single_precision ? sizeof(float) : sizeof(double);
    end.incoming.resize(in.populations.size() *
                        static_cast<std::size_t>(in.layers * populations.layer_size()) * value);
    // Told apart by the way they go: two ranks may be neighbours at both ends.
    outgoing[count] = {end.partner, end.towards > 0 ? 1 : 0, end.outgoing};
    incoming[count] = {end.partner, end.towards > 0 ? 0 : 1, end.incoming};
    taking_part[count++] = &end;
  }
  ranks_.exchange({outgoing.data(), count}, {incoming.data(), count});
  for (std::size_t n = 0; n < count; ++n)
    unpack(populations, parts(*taking_part[n]).second, taking_part[n]->incoming);
}

void Halo::take_back(Populations& populations, bool between_slabs, bool across_period) {
  transfer(populations, between_slabs, across_period, [&](const End& end) {
    return std::pair{Part{crossing(end.towards), end.outer}, Part{crossing(-end.towards), end.inner}};
  });
}

void Halo::give(Populations& populations, bool between_slabs, bool across_period, bool everything) {
  transfer(populations, between_slabs, across_period, [&](const End& end) {
    if (!everything) {
      return std::pair{Part{crossing(-end.towards), end.inner}, Part{crossing(end.towards), end.outer}};
    }
    constexpr int halo = Populations::halo;
    return std::pair{Part{all_, end.towards > 0 ? end.inner - halo + 1 : end.inner, halo},
                     Part{all_, end.towards > 0 ? end.outer : end.outer - halo + 1, halo}};
  });
}

}  // namespace estuary::fluid
