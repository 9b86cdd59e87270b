// Parts of the engine that Python does not reach by themselves; see test_engine_checks.py.
#include <cstdio>
#include <cstdlib>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "budgets.hpp"
#include "chain_stats.hpp"
#include "neighbours.hpp"
#include "parallel.hpp"
#include "trace.hpp"

using namespace asterism;

#define CHECK(what)                                                     \
  if (!(what)) {                                                        \
    std::fprintf(stderr, "line %d: not so: %s\n", __LINE__, #what);     \
    std::exit(1);                                                       \
  }

// An exception in a task ended the process; now the first one, by number, reaches the caller.
void exceptions_reach_the_caller() {
  for (int repeat = 0; repeat < 200; ++repeat) {
    std::string caught;
    try {
      in_parallel(100, 4, [](std::int32_t, std::int64_t k) {
        if (k >= 3) throw std::runtime_error(std::to_string(k));
      });
    } catch (const std::runtime_error& error) {
      caught = error.what();
    }
    CHECK(caught == "3");
  }
  std::vector<int> done(1000, 0);
  in_parallel(1000, 3, [&](std::int32_t, std::int64_t k) { ++done[k]; });
  for (const int n : done) CHECK(n == 1);
}

// Moves without limit, weights of nothing and deadlines beyond any clock were cast to integers,
// which the undefined-behaviour sanitizer reports.
void budgets_of_nothing_and_of_everything() {
  const double inf = std::numeric_limits<double>::infinity();
  const std::vector<double> weights{0, 1, 5};
  const Budgets endless(weights, inf);
  CHECK(endless.of(0).moves == 0 && endless.of(1).moves > 1'000'000'000);
  const std::vector<double> nothing{0, 0};
  Budgets idle(nothing, inf);
  idle.end_at(after(Clock::now(), 1e-3), nothing, 1, 1);
  CHECK(idle.of(0).moves == 0 && idle.of(1).is_over(0));
  Budgets late(weights, 10);
  late.end_at(after(Clock::now(), 1e300), weights, 2, 2);
  CHECK(!late.of(1).is_over(0));
  bool was_asked = false;
  Watch watch(0, [&](double share) {
    was_asked = true;
    CHECK(share >= 0 && share <= 1);
    return true;
  });
  while (!was_asked) watch.is_stopped_before(0);
}

// The first half of a chain took all the time there was, and the second was left with 16 moves.
void each_half_has_half_of_the_time() {
  const Clock::time_point now = Clock::now(), end = after(now, 10);
  const double first = std::chrono::duration<double>(halfway_to(end) - now).count();
  CHECK(first > 4.9 && first < 5.2);
  CHECK(halfway_to(Clock::time_point::max()) == Clock::time_point::max());
  CHECK(halfway_to(after(now, -1)) <= Clock::now());
}

// A chain that never moved was reported with as many effective samples as moves, and R-hat 1.
void mixing_that_is_not_known() {
  Trace still;
  for (int half = 0; half < 2; ++half) {
    still.begin(50);
    for (int n = 0; n < 50; ++n) still.add(1.5);
  }
  CHECK(std::isnan(still.ess_of_halves(100)));
  ChainStats known, unknown;
  CHECK(std::isnan(known.rhat) && std::isnan(known.ess));
  known.add_mixing(1.2, 30);
  known.add_mixing(1.1, 20);
  known.add(unknown);
  CHECK(known.rhat == 1.2 && known.ess == 20);
}

// The table was as large as the largest number ever given, and said that marker 0 was somewhere
// before any marker was.
void places_by_number() {
  Places places;
  CHECK(places.find(0) == nullptr);
  for (const std::int32_t first : {0, 1'000'000, 2'000'000'000}) {
    places.clear();
    for (std::int32_t k = 0; k < 100; ++k) places.set(first + 7 * k, Point{{double(k), 0, 0}});
    for (std::int32_t k = 0; k < 100; ++k) {
      CHECK(places.find(first + 7 * k) != nullptr && (*places.find(first + 7 * k))[0] == k);
      CHECK(places.find(first + 7 * k + 1) == nullptr);
    }
    places.set(first, Point{{-1, 0, 0}});
    CHECK((*places.find(first))[0] == -1);
  }
  CHECK(sizeof(Places) < 100 && places.capacity() <= 512);
}

int main() {
  exceptions_reach_the_caller();
  budgets_of_nothing_and_of_everything();
  each_half_has_half_of_the_time();
  mixing_that_is_not_known();
  places_by_number();
}
