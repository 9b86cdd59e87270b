// Runs the filter along the tails of edits. The detections of an edit are first planned; their states
// and scores follow one by one, so that an evaluation can end as soon as its result is certain.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "mcmc/model/partition.hpp"

namespace asterism {

// The detection before the n-th of a tail, which must not be the first of the track.
template <typename Filter>
std::int32_t before(const Partition<Filter>& p, const Edit<Filter>& edit, std::size_t n) {
  return n == 0 ? p.track(edit.track).nodes[edit.keep - 1] : edit.tail.nodes[n - 1];
}

// The gain of the score by a link from the present state of i to j.
template <typename Filter>
double link_gain(const Partition<Filter>& p, std::int32_t i, std::int32_t j) {
  double& gain = p.known_gain(i, j);
  if (std::isnan(gain)) {
    const DetectionWindow& window = p.window();
    const auto gap = static_cast<int>(window[j].frame - window[i].frame);
    p.filter().expect(p.motion(), window, p.state(i), window[i].frame, gap, p.expected());
    gain = p.gap_score(gap) + Filter::log_likelihood(p.motion(), p.expected(), window[j].y);
  }
  return gain;
}

// Filters the next planned detection of an edit, with its continuation. Before the update of the
// state, calls goes_on(gain of the score by the detection); if that is false, returns false and
// leaves the detection planned. `expected` is working memory.
template <typename Filter, typename GoesOn>
bool filter_next(const Partition<Filter>& p, Edit<Filter>& edit, GoesOn&& goes_on,
                 typename Filter::Expected& expected) {
  const DetectionWindow& window = p.window();
  Tail<Filter>& tail = edit.tail;
  const std::size_t n = tail.states.size();
  const std::int32_t j = tail.nodes[n];
  if (edit.keep == 0 && n == 0) {
    if (!goes_on(p.begin_score())) return false;
    tail.states.push_back(p.filter().begin(p.motion(), window[j].y, window[j].frame));
    tail.scores.push_back(p.begin_score());
  } else {
    const std::int32_t i = before(p, edit, n);
    const auto gap = static_cast<int>(window[j].frame - window[i].frame);
    p.filter().expect(p.motion(), window, n == 0 ? p.state(i) : tail.states.back(),
                      window[i].frame, gap, expected);
    const double gain = p.gap_score(gap) + p.filter().weigh(p.motion(), expected, window[j].y);
    if (!goes_on(gain)) return false;
    tail.scores.push_back((n == 0 ? p.score(i) : tail.scores.back()) + gain);
    p.filter().take(p.motion(), expected, window[j].y, tail.states.emplace_back());
  }
  if (p.is_continuation(j))
    tail.scores.back() +=
        p.continuations().advance(p.motion(), window, p.filter(), j, tail.states.back());
  return true;
}

template <typename Filter, typename GoesOn>
bool filter_next(const Partition<Filter>& p, Edit<Filter>& edit, GoesOn&& goes_on) {
  return filter_next(p, edit, goes_on, p.expected());
}

// Appends a detection to the tail of an edit, with its continuation if it has one.
template <typename Filter>
void append(const Partition<Filter>& p, Edit<Filter>& edit, std::int32_t j,
            typename Filter::Expected& expected) {
  edit.tail.nodes.push_back(j);
  filter_next(p, edit, [](double) { return true; }, expected);
}
template <typename Filter>
void append(const Partition<Filter>& p, Edit<Filter>& edit, std::int32_t j) {
  append(p, edit, j, p.expected());
}
// Appends the present next detection, whose state and score stay valid without earlier changes.
template <typename Filter>
void append_same(const Partition<Filter>& p, Edit<Filter>& edit, std::int32_t j) {
  edit.tail.nodes.push_back(j);
  edit.tail.states.push_back(p.state(j));
  edit.tail.scores.push_back(p.score(j));
}

// The largest gain of the score by the n-th detection of a tail, without its continuation. That of
// the first one is known; the density of the others is bounded.
template <typename Filter>
double max_gain(const Partition<Filter>& p, const Edit<Filter>& edit, std::size_t n) {
  const DetectionWindow& window = p.window();
  const std::int32_t j = edit.tail.nodes[n];
  if (n == 0) return edit.keep == 0 ? p.begin_score() : link_gain(p, before(p, edit, 0), j);
  const std::int64_t frame = window[j].frame;
  const auto gap = static_cast<int>(frame - window[before(p, edit, n)].frame);
  const DetectionWindow::Steps& steps = *window.frame(frame).steps;
  const bool is_second = edit.keep == 0 && n == 1 && gap == 1;
  return p.gap_score(gap) + (is_second ? steps.log_peak : steps.log_later_peak);
}

// An upper bound of the score of an edit, of which some detections may be planned. Detections after
// the first `n_filtered` of the tail add what they add at present; they must follow each other in
// the present partition as well.
template <typename Filter>
double max_score_of(const Partition<Filter>& p, const Edit<Filter>& edit,
                    std::size_t n_filtered = std::numeric_limits<std::size_t>::max()) {
  const Tail<Filter>& tail = edit.tail;
  const std::size_t n = tail.states.size();
  if (n == tail.nodes.size()) return p.score_of(edit);
  const std::size_t n_last = std::min(n_filtered, tail.nodes.size());
  double score = n > 0 ? tail.scores.back() : edit.keep > 0 ? p.score(before(p, edit, 0)) : 0;
  for (std::size_t k = n; k < n_last; ++k) {
    const std::int32_t j = tail.nodes[k];
    score += max_gain(p, edit, k);
    if (p.is_continuation(j)) score += p.continuations().max_gain(p.window(), j);
  }
  const std::int32_t last = tail.nodes.back();
  if (n_last < tail.nodes.size()) score += p.score(last) - p.score(tail.nodes[n_last - 1]);
  return score + p.end_score(last);
}

// Whether every continuation is in a track after the edits.
template <typename Filter>
bool keeps_continuations(const Partition<Filter>& p, std::span<const Edit<Filter>> edits) {
  for (const Edit<Filter>& edit : edits) {
    if (edit.track < 0 || edit.keep == p.track(edit.track).size()) continue;
    const std::int32_t end = p.last(edit.track);
    if (p.is_continuation(end) && std::ranges::none_of(edits, [&](const Edit<Filter>& other) {
          return !other.tail.nodes.empty() && other.tail.nodes.back() == end;
        }))
      return false;
  }
  return true;
}

}  // namespace asterism
