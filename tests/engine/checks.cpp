// Tests of engine parts that Python cannot reach separately; `make sanitize` runs them.
#include <cstdio>
#include <cstdlib>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "mcmc/chain/budgets.hpp"
#include "mcmc/tracker/capture_sweep.hpp"
#include "mcmc/chain/chain_stats.hpp"
#include "rigid/carried.hpp"
#include "rigid/neighbours.hpp"
#include "base/flat_map.hpp"
#include "base/parallel.hpp"
#include "mcmc/chain/trace.hpp"
#include "math/lanes.hpp"
#include "math/random.hpp"
#include "multiview/candidate_choice.hpp"

using namespace asterism;

#define CHECK(what)                                                     \
  if (!(what)) {                                                        \
    std::fprintf(stderr, "line %d: not so: %s\n", __LINE__, #what);     \
    std::exit(1);                                                       \
  }

// An exception in a task must reach the caller; of several, the one with the smallest task number.
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

// Infinite numbers of moves, zero weights and distant deadlines must not overflow when cast to
// integers.
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

// A share of a budget has that share of the moves and of the time.
void a_share_of_a_budget() {
  const Clock::time_point now = Clock::now(), end = after(now, 10);
  const Budget half = Budget{1001, end}.first(0.5, now);
  const double seconds = std::chrono::duration<double>(half.until - now).count();
  CHECK(half.moves == 501 && seconds > 4.9 && seconds < 5.1);
  CHECK((Budget{1, end}.first(1, now).until == end));
  CHECK((Budget{1}.first(0.5, now).until == Clock::time_point::max()));
  CHECK((Budget{1, now}.first(0.5, after(now, 1)).until < after(now, 1)));
}

// A chain that never moved has no known effective sample size and no R-hat.
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

// The table must not grow with the largest marker number, and must be empty before the first
// marker.
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

// The gain of a change of two tracks must be the same in a block as in the whole capture. The block
// must include the detections after it, and the missed frames of a track that ends.
using Swept = CaptureSweep<OneMotion>;

double gain_of_exchange(const Swept::Part& part, std::int64_t from, bool is_cut) {
  const Partition<OneMotion>& p = part.partition;
  std::vector<std::int32_t> starts(2, -1);  // by track, its first detection from there on
  for (std::int32_t i = 0; i < p.window().n_ids(); ++i)
    if (part.numbers[i] >= 2 * from && part.numbers[i] < 2 * from + 2)
      starts[part.numbers[i] % 2] = i;
  std::vector<Edit<OneMotion>> edits(2);
  for (int k = 0; k < 2; ++k) {
    edits[k].track = p.track_of(starts[k]);
    edits[k].keep = p.place_of(starts[k]);
    const std::int32_t other = starts[1 - k];
    const auto& nodes = p.track(p.track_of(other)).nodes;
    if (!is_cut)
      for (std::size_t n = p.place_of(other); n < nodes.size(); ++n) append(p, edits[k], nodes[n]);
  }
  double gain = 0;
  for (const auto& edit : edits) gain += p.score_of(edit) - p.score_of(edit.track);
  return gain;
}

void a_block_gains_what_the_capture_gains() {
  constexpr std::int64_t T = 160, ended = 70;
  constexpr double dt = 0.01, noise = 1e-3, acceleration = 5;
  MotionModel m;
  m.axis = {2, 2, {1, 0}, {noise * noise, 0, 0, 1}, noise * noise};
  ScoreModel sm{.log_birth = -2, .log_clutter = -1, .log_survive = std::log(0.999),
                .p_disappear = 1e-3, .p_detection = 0.9, .p_redetection = 0.05, .max_speed = 100,
                .speed_margin = 1, .max_gap = 3};
  MotionStep step;
  const double q = acceleration * acceleration;
  step.mode[0].F = {1, dt, 0, 1};
  step.mode[0].Q = {q * dt * dt * dt * dt / 4, q * dt * dt * dt / 2, q * dt * dt * dt / 2, q * dt * dt};
  for (const bool is_cut : {false, true}) {
    // Two markers pass each other; where the ends are compared, both disappear after some frames.
    Swept short_blocks(40, sm.max_gap), one_block(1000, sm.max_gap);
    for (Swept* sweep : {&short_blocks, &one_block}) {
      for (std::int64_t t = 0; t < T; ++t) {
        const double x = 1e-3 * static_cast<double>(t), wave = 2e-3 * std::sin(0.9 * t);
        std::vector<Point> points;
        if (!is_cut || t < ended) points = {Point{{x, wave}}, Point{{x + 2e-3, 3e-3 - 0.5 * wave}}};
        sweep->add_frame(dt * static_cast<double>(t), step, points);
        for (std::size_t k = 0; k < points.size(); ++k)
          sweep->set_label(2 * t + static_cast<std::int64_t>(k), static_cast<std::int64_t>(k));
      }
      sweep->link_labels();
    }
    const Partition<OneMotion> empty(m, sm);
    const Swept::Part whole = one_block.take(empty, one_block.blocks().front());
    int n_checked = 0;
    for (const Swept::Block& block : short_blocks.blocks()) {
      const Swept::Part part = short_blocks.take(empty, block);
      for (std::int64_t t = block.first + 2; t <= block.last && t < (is_cut ? ended : T - 2); ++t) {
        const double own = gain_of_exchange(part, t, is_cut);
        // continues after the block, so it must not end in it
        if (is_cut && block.last < ended) continue;
        CHECK(std::abs(own - gain_of_exchange(whole, t, is_cut)) < 1e-6 * (1 + std::abs(own)));
        ++n_checked;
      }
      short_blocks.keep_states(block, part);
    }
    CHECK(n_checked > 20);
  }
}

// The evaluation of a move ends as soon as its gain is bounded too low. So no detection may gain more
// than its bound, in tracks with gaps, uneven steps and points with variances of their own.
template <typename Filter>
void no_gain_exceeds_its_bound(int n_modes) {
  MotionModel m;
  m.axis = {2, 3, {1, 0}, {1e-8, 0, 0, 1e-8}, 1e-4};  // less than after a later detection
  m.M = n_modes;
  if (n_modes == 3) m.T = {0.9, 0.05, 0.05, 0.1, 0.8, 0.1, 0.2, 0.3, 0.5};
  m.w0 = stationary(m.T, m.M);
  const ScoreModel sm{.log_birth = -2, .log_clutter = -1, .log_survive = -1e-3,
                      .p_disappear = 1e-3, .p_detection = 0.9, .p_redetection = 0.05,
                      .max_speed = 100, .speed_margin = 100, .max_gap = 3};
  Random random(1);
  Partition<Filter> p(m, sm);
  constexpr int T = 16, K = 3;
  double time = 0;
  for (int t = 0; t < T; ++t) {
    const double dt = 0.5 + random.uniform();
    time += dt;
    MotionStep step;
    for (int b = 0; b < n_modes; ++b) {
      const double q = 1e-3 * std::pow(20.0, b);
      step.mode[b].F = {1, dt, 0, 1};
      step.mode[b].Q = {q * dt * dt * dt * dt / 4, q * dt * dt * dt / 2, q * dt * dt * dt / 2, q * dt * dt};
    }
    std::vector<Point> points;
    for (int k = 0; k < K; ++k)
      points.push_back(Point{{1e-3 * time + 1e-4 * random.uniform(), 0.03 * k, 0},
                             random.uniform() < 0.1 ? 1e-4 : 0.0});
    p.add_frame(time, step, points, K * t);
  }
  double smallest = 1;  // distance of a gain from its bound
  for (int trial = 0; trial < 2000; ++trial) {
    Edit<Filter> edit;
    std::int32_t k = random.below(K);
    for (std::int64_t t = random.below(5); t < T; t += random.uniform() < 0.7 ? 1 : 1 + random.below(3)) {
      if (random.uniform() < 0.2) k = random.below(K);
      edit.tail.nodes.push_back(p.window().frame(t).ids[k]);
    }
    for (std::size_t n = 0; n < edit.tail.nodes.size(); ++n) {
      const double bound = max_gain(p, edit, n), of_all = max_score_of(p, edit);
      filter_next(p, edit, [&](double gain) {
        CHECK(gain <= bound + 1e-9);
        if (n > 0) smallest = std::min(smallest, bound - gain);
        return true;
      });
      CHECK(max_score_of(p, edit) <= of_all + 1e-9);
    }
    // Detections that are not filtered count with their present gain.
    p.apply(std::span(&edit, 1));
    const auto& nodes = p.track(edit.track).nodes;
    Edit<Filter> same;
    same.track = edit.track;
    same.keep = random.below(p.track(edit.track).size() - 1);
    same.tail.nodes.assign(nodes.begin() + same.keep, nodes.end());
    const std::size_t n_filtered = 1 + random.below(static_cast<std::int32_t>(same.tail.nodes.size()));
    for (std::size_t n = 0; n < n_filtered; ++n) filter_next(p, same, [](double) { return true; });
    CHECK(std::abs(max_score_of(p, same, n_filtered) - p.score_of(edit.track)) < 1e-9);
    Edit<Filter> none;
    none.track = edit.track;
    p.apply(std::span(&none, 1));
  }
  CHECK(smallest < 0.5);
}

// Candidates of image points, and the optimal choice by enumeration of all sets.
struct ChoiceProblem {
  std::vector<std::vector<std::int32_t>> uses;
  std::vector<double> scores;
  std::size_t n_points;

  ChoiceProblem(Random& random, int n, int m) : n_points(m) {
    for (int i = 0; i < n; ++i) {
      uses.emplace_back();
      for (int k = random.below(3); k >= 0; --k)
        if (const std::int32_t p = random.below(m); std::ranges::find(uses[i], p) == uses[i].end())
          uses[i].push_back(p);
      scores.push_back(1 + 5 * random.uniform());
    }
  }
  double best(std::size_t from, std::vector<char> is_used) const {
    if (from == uses.size()) return 0;
    const double without = best(from + 1, is_used);
    for (const std::int32_t p : uses[from])
      if (is_used[p]++) return without;
    return std::max(without, scores[from] + best(from + 1, is_used));
  }
  // The total score of a choice, which must use no point twice.
  double total_score(const std::vector<std::int32_t>& chosen) const {
    std::vector<char> is_used(n_points, 0);
    double sum = 0;
    for (const std::int32_t c : chosen) {
      sum += scores[c];
      for (const std::int32_t p : uses[c]) CHECK(!is_used[p]++);
    }
    return sum;
  }
};

void choices_of_candidates_are_the_best_or_tell_by_how_much_not() {
  Random random(6);
  std::int64_t n_packed = 0, n_cut = 0;
  for (int repeat = 0; repeat < 200; ++repeat) {
    const ChoiceProblem problem(random, 4 + random.below(12), 4 + random.below(6));
    const double best = problem.best(0, std::vector<char>(problem.n_points, 0));
    for (const std::int64_t max_nodes : {1'000'000, 1}) {
      ChoiceSummary summary;
      const double total_score = problem.total_score(
          CandidateChoice(problem.uses, problem.scores, problem.n_points).solve(max_nodes, summary));
      CHECK(total_score <= best + 1e-6 && best <= total_score + summary.gap + 2e-6);
      if (max_nodes > 1) CHECK(summary.n_inexact == 0 && summary.gap == 0);
      n_packed += summary.n_packed;
      n_cut += summary.n_inexact;
    }
  }
  CHECK(n_packed > 20 && n_cut > 5);
}

// A flat map holds what std::map holds, whatever is inserted and removed.
void flat_maps_are_maps() {
  Random random(3);
  for (int repeat = 0; repeat < 300; ++repeat) {
    FlatMap<int, int> flat;
    std::map<int, int> map;
    for (int n = 0; n < repeat % 40; ++n) {
      const int key = static_cast<int>(random.below(60));
      if (random.below(4) == 0) {
        flat.erase(key);
        map.erase(key);
      } else {
        flat[key] = map[key] = n;
      }
    }
    flat.erase_if([](const auto& entry) { return entry.first % 7 == 0; });
    std::erase_if(map, [](const auto& entry) { return entry.first % 7 == 0; });
    CHECK(std::equal(flat.begin(), flat.end(), map.begin(), map.end(), [](const auto& a, const auto& b) {
      return a.first == b.first && a.second == b.second;
    }));
    for (int key = -1; key < 61; ++key) {
      const int* found = flat.find(key);
      CHECK((found != nullptr) == map.contains(key) && (found == nullptr || *found == map.at(key)));
    }
  }
}

// The logarithm of a product, and what is no number.
void products_of_many_numbers() {
  LogProduct product;
  double expected = 0;
  for (int n = 0; n < 5000; ++n) {
    const double x = std::exp(37 * std::sin(n * 0.7));
    product.multiply(x);
    expected += std::log(x);
  }
  for (int i = 0; i < kLanes; ++i) CHECK(std::abs(product.log(i) - expected) < 1e-9);
  for (const double wrong : {std::numeric_limits<double>::infinity(), std::nan("")}) {
    LogProduct invalid;
    invalid.multiply(2);
    invalid.multiply(wrong);
    invalid.multiply(2);
    CHECK(std::isnan(invalid.log(0)));
  }
  for (const double x : {0.0, -1e-9, -0.3, -1.0, -50.0, -600.0})
    CHECK(std::abs(exp_of_negative(x).at[1] / std::exp(x) - 1) < 1e-15);
}

// Predictions do not depend on those that are computed beside them, to the last bit: sets of unlike
// sizes, points in one place and on a line, in lanes that are full and in those left over.
void predictions_side_by_side_are_those_alone() {
  struct Problem {
    std::vector<RigidPair> pairs;
    Point then;
    std::vector<double> expected, found;
  };
  const auto predict = [](int D, auto&& problems, std::vector<double> Problem::* out) {
    RigidPredictions().each(
        D, 1e-6, problems,
        [](const Problem& one, Point& then) {
          then = one.then;
          return std::span(one.pairs);
        },
        [&](Problem& one, const RigidPrediction& p) {
          const Carried place = p.place(1e-6, 1);
          one.*out = {place.at[0], place.at[1], place.at[2], place.variance, p.turned()[0],
                      p.turned()[1], p.turned()[2], p.turned_variance(1e-6, 0.5), p.nearest2(),
                      static_cast<double>(p.n_neighbours())};
        });
  };
  Random random(7);
  for (int repeat = 0; repeat < 600; ++repeat) {
    const int D = 1 + repeat % 3;
    std::vector<Problem> problems(static_cast<std::size_t>(repeat % 11));
    for (Problem& one : problems) {
      const int n = static_cast<int>(9 * random.uniform()), shape = static_cast<int>(4 * random.uniform());
      one.pairs.resize(static_cast<std::size_t>(n));
      for (int d = 0; d < D; ++d) one.then[d] = random.uniform();
      for (RigidPair& p : one.pairs) {
        const double along = random.uniform();
        p.weight = 0.1 + random.uniform();
        for (int d = 0; d < D; ++d) {
          p.a[d] = shape == 0 ? 1 : shape == 1 ? along * d : random.uniform();
          p.b[d] = p.a[d] + 0.1 * random.uniform();
        }
      }
    }
    predict(D, problems, &Problem::found);
    for (Problem& one : problems) {
      predict(D, std::span(&one, 1), &Problem::expected);
      CHECK(one.expected.empty() == one.pairs.empty());
      CHECK(one.found == one.expected);
    }
  }
}

int main() {
  predictions_side_by_side_are_those_alone();
  choices_of_candidates_are_the_best_or_tell_by_how_much_not();
  a_block_gains_what_the_capture_gains();
  no_gain_exceeds_its_bound<OneMotion>(1);
  no_gain_exceeds_its_bound<SeveralMotions>(3);
  exceptions_reach_the_caller();
  budgets_of_nothing_and_of_everything();
  a_share_of_a_budget();
  mixing_that_is_not_known();
  places_by_number();
  flat_maps_are_maps();
  products_of_many_numbers();
}
