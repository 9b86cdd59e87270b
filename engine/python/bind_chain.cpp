// Bindings of the MCMC data association chain.
#include <nanobind/stl/tuple.h>

#include <memory>
#include <variant>

#include "mcmc/chain/sampler.hpp"
#include "mcmc/chain/tally.hpp"
#include "python/bindings.hpp"
#include "python/motion_arrays.hpp"

using namespace nb::literals;
using namespace asterism;

namespace {

class Chain {
  template <typename F>
  decltype(auto) visit(F&& f) {
    return std::visit([&](auto& s) -> decltype(auto) { return f(*s); }, sampler_);
  }
  template <typename F>
  decltype(auto) visit(F&& f) const {
    return std::visit([&](const auto& s) -> decltype(auto) { return f(std::as_const(*s)); },
                      sampler_);
  }

 public:
  Chain(const MotionModel& m, const ScoreModel& sm, const ChainOptions& options, std::uint64_t seed)
      : m_(m) {
    if (m.M == 1)
      sampler_ = std::make_unique<Sampler<OneMotion>>(m, sm, options, seed);
    else
      sampler_ = std::make_unique<Sampler<SeveralMotions>>(m, sm, options, seed);
  }

  void add_frame(double time, const In<double>& F, const In<double>& Q, const In<double>& points) {
    const std::vector<Point> frame = to_points(points, m_.axis.D);
    const MotionStep step = motion_step(m_, F, Q);
    visit([&](auto& s) { s.partition().add_frame(time, step, frame, n_seen_); });
    n_seen_ += static_cast<std::int64_t>(frame.size());
  }

  void freeze(std::int64_t frame) {
    visit([&](auto& s) {
      require(frame <= s.partition().window().now(), "frame: one that was added");
      s.partition().freeze(frame);
    });
  }

  // Replaces the present tracks by those of `labels`. Nothing may be settled yet.
  void assign(const In<std::int64_t>& labels) {
    require(static_cast<std::int64_t>(labels.size()) == n_seen_, "labels: one for each detection");
    visit([&](auto& s) { assign_to(s, labels.data()); });
  }

  // Makes the tracks those of markers that accelerate together: each is of the marker whose label the
  // first of its labelled detections has.
  void give(const In<std::int64_t>& labels, const SharedAcceleration& shared) {
    require(static_cast<std::int64_t>(labels.size()) == n_seen_, "labels: one for each detection");
    for (const std::int64_t label : flat(labels))
      require(label < static_cast<std::int64_t>(shared.size()), "labels: markers");
    visit([&](auto& s) {
      auto& p = s.partition();
      p.give(std::make_shared<const GivenLabels>(GivenLabels{
          0, {labels.data(), labels.data() + labels.size()}, std::make_shared<const SharedAcceleration>(shared)}));
      std::vector<std::int32_t> tracks;
      for (const std::int32_t k : p.tracks().items()) tracks.push_back(k);
      s.begin_part(p, tracks);
    });
  }

  Out<std::int64_t> labels() const {
    return visit([&](const auto& s) { return array_of<std::int64_t>(labels_of(s.partition())); });
  }
  double log_posterior() const {
    return visit([](const auto& s) { return s.partition().log_posterior(); });
  }

  void run(std::int64_t n_moves) {
    nb::gil_scoped_release release;
    visit([&](auto& s) {
      for (std::int64_t n = 0; n < n_moves; ++n) s.step();
    });
  }

  // Returns (labels of each partition, number of moves after which the chain was in it).
  nb::tuple visits(std::int64_t n_moves) {
    std::unordered_map<std::uint64_t, Visited> visited;
    {
      nb::gil_scoped_release release;
      visited = visit([&](auto& s) { return tally(s, n_moves); });
    }
    std::vector<std::int64_t> labels, counts;
    for (const auto& [key, one] : visited) {
      labels.insert(labels.end(), one.labels.begin(), one.labels.end());
      counts.push_back(one.count);
    }
    return nb::make_tuple(
        array_of<std::int64_t>(labels, {visited.size(), static_cast<std::size_t>(n_seen_)}),
        array_of<std::int64_t>(counts));
  }

  // Returns the evaluated moves one by one: (kind, auxiliary draw, labels before and after, log q
  // forward and reverse, gain, whether it was accepted).
  nb::list trace(std::int64_t n_moves) {
    nb::list out;
    visit([&](auto& s) {
      s.weigh_above(-std::numeric_limits<double>::infinity());
      for (std::int64_t n = 0; n < n_moves; ++n) trace_one(s, out);
      s.weigh_above(Sampler<OneMotion>::kOnlyWhatMayBeTaken);
    });
    return out;
  }

 private:
  template <typename Filter>
  static void assign_to(Sampler<Filter>& s, const std::int64_t* labels) {
    Partition<Filter>& p = s.partition();
    std::vector<Edit<Filter>> edits;
    for (const std::int32_t k : p.tracks().items()) {
      require(p.track(k).n_frozen == 0, "labels: before anything is settled");
      edits.emplace_back().track = k;
    }
    p.apply(edits);
    edits.clear();
    std::unordered_map<std::int64_t, std::size_t> place;
    const DetectionWindow& window = p.window();
    for (std::int64_t t = window.first(); t <= window.now(); ++t)
      for (const std::int32_t i : window.frame(t).ids) {
        const std::int64_t label = labels[window[i].number];
        if (label < 0) continue;
        const auto [at, is_new] = place.try_emplace(label, edits.size());
        if (is_new) edits.emplace_back();
        Edit<Filter>& edit = edits[at->second];
        require(is_new || window.is_linkable(edit.tail.nodes.back(), i), "labels: tracks of the model");
        append(p, edit, i);
      }
    for (const Edit<Filter>& edit : edits)
      require(edit.tail.nodes.size() > 1, "labels: at least two detections of each track");
    p.apply(edits);
  }

  template <typename Filter>
  void trace_one(Sampler<Filter>& s, nb::list& out) {
    const std::vector<std::int64_t> before = labels_of(s.partition());
    const double value = s.partition().log_posterior();
    s.step([&](const Change<Filter>& q, bool is_taken) {
      std::int64_t with = q.with;
      if (q.with >= 0 && q.move != Move::update) with = s.partition().window()[q.with].number;
      Partition<Filter> copy(s.partition());
      std::vector<Edit<Filter>> edits(q.edits.begin(), q.edits.begin() + q.n_edits);
      copy.apply(edits);
      out.append(nb::make_tuple(static_cast<std::int64_t>(q.move), with,
                                array_of<std::int64_t>(before),
                                array_of<std::int64_t>(labels_of(copy)), q.log_forward,
                                q.log_reverse, q.gain, is_taken, value));
    });
  }

  MotionModel m_;
  std::variant<std::unique_ptr<Sampler<OneMotion>>, std::unique_ptr<Sampler<SeveralMotions>>>
      sampler_;
  std::int64_t n_seen_ = 0;
};

}  // namespace

void bind_chain(nb::module_& module) {
  nb::class_<Chain>(module, "Chain")
      .def(nb::init<const MotionModel&, const ScoreModel&, const ChainOptions&, std::uint64_t>(),
           "model"_a, "score"_a, "options"_a, "seed"_a)
      .def("add_frame", &Chain::add_frame, "time"_a, "F"_a, "Q"_a, "points"_a)
      .def("freeze", &Chain::freeze, "frame"_a)
      .def("assign", &Chain::assign, "labels"_a)
      .def("give", &Chain::give, "labels"_a, "shared"_a)
      .def("labels", &Chain::labels)
      .def("log_posterior", &Chain::log_posterior)
      .def("run", &Chain::run, "n_moves"_a)
      .def("visits", &Chain::visits, "n_moves"_a)
      .def("trace", &Chain::trace, "n_moves"_a);
}
