// Numbers drawn from a seed: the same on every machine, with no state but its own.
#pragma once
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <span>

namespace vss {

// Scrambles 64 bits (the finaliser of SplitMix64; Steele, Lea, Flood 2014).
inline std::uint64_t Scramble(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

// SplitMix64.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(Scramble(seed + kStep)) {}

  std::uint64_t Bits() { return Scramble(state_ += kStep); }
  double Uniform() { return static_cast<double>(Bits() >> 11) * 0x1p-53; }  // [0, 1)
  double Uniform(double from, double to) { return from + (to - from) * Uniform(); }
  int Integer(int from, int to) {  // both included
    return from + static_cast<int>(Bits() % static_cast<std::uint64_t>(to - from + 1));
  }
  bool Chance(double probability) { return Uniform() < probability; }
  double Normal() {  // Box, Muller 1958
    const double radius = std::sqrt(-2 * std::log(1 - Uniform()));
    return radius * std::cos(6.283185307179586 * Uniform());
  }
  template <class T>
  T Pick(std::initializer_list<T> list) {
    return list.begin()[Integer(0, static_cast<int>(list.size()) - 1)];
  }

 private:
  static constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15ULL;
  std::uint64_t state_;
};

}  // namespace vss
