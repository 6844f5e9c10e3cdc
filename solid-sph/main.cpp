#include "serve.hpp"
#include "solid.hpp"

int main(int argc, char** argv) {
  return estuary::serve(argc, argv, std::make_unique<estuary::solid::Solid>());
}
