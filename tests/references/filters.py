"""Kalman filter, smoother and interacting motions as the textbooks have them."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import multivariate_normal

if TYPE_CHECKING:
    from asterism.model import TrackingModel


def kalman(model: TrackingModel, times, frames, points, extra=None):
    """Textbook filter of one track with one mode: full state of all axes, full covariances.

    A detection i may have noise of its own, of variance `extra[i]` on every axis.

    Returns the filtered means and covariances of each frame of the track, the predicted ones, the
    transitions into each frame, and the log density of each detection.
    """
    D = points.shape[1]
    motion = model.motion.modes[0]
    n = len(motion.observation)
    eye = np.eye(D)
    H = np.kron(eye, motion.observation)
    extra = np.zeros(len(points)) if extra is None else extra
    h = motion.observation
    x = np.concatenate([h / (h @ h) * p for p in points[0]])
    P = np.kron(eye, model.initial_covariance(D) + extra[0] * np.outer(h, h) / (h @ h) ** 2)
    means, covariances, predicted, transitions = [x], [P], [(x, P)], [np.eye(n * D)]
    log_densities = [0.0]
    i = 1
    for t in range(frames[0] + 1, frames[-1] + 1):
        dt = times[t] - times[t - 1]
        F = np.kron(eye, motion.transition(dt)[0])
        Q = np.kron(eye, motion.process_noise(dt)[0])
        x, P = F @ x, F @ P @ F.T + Q
        predicted.append((x, P))
        transitions.append(F)
        if frames[i] == t:
            S = H @ P @ H.T + (model.sensor.noise_sigma**2 + extra[i]) * eye
            log_densities.append(multivariate_normal(H @ x, S).logpdf(points[i]))
            K = P @ H.T @ np.linalg.inv(S)
            x = x + K @ (points[i] - H @ x)
            P = P - K @ S @ K.T
            i += 1
        means.append(x)
        covariances.append(P)
    return means, covariances, predicted, transitions, np.array(log_densities)


def rts(means, covariances, predicted, transitions):
    """Textbook Rauch-Tung-Striebel smoother over the output of `kalman`."""
    xs, Ps = [means[-1]], [covariances[-1]]
    for t in range(len(means) - 2, -1, -1):
        F = transitions[t + 1]
        x_next, P_next = predicted[t + 1]
        C = covariances[t] @ F.T @ np.linalg.inv(P_next)
        xs.append(means[t] + C @ (xs[-1] - x_next))
        Ps.append(covariances[t] + C @ (Ps[-1] - P_next) @ C.T)
    return xs[::-1], Ps[::-1]


def imm_log_densities(model: TrackingModel, times, frames, points):
    """Interacting multiple models of one track, axis-shared covariances, in plain NumPy."""
    D = points.shape[1]
    modes = model.motion.modes
    T = np.asarray(model.motion.mode_transitions)
    h = modes[0].observation
    r = model.sensor.noise_sigma**2
    M = len(modes)
    # Stationary weights: w T = w, summing to 1.
    w = np.linalg.lstsq(np.vstack([T.T - np.eye(M), np.ones(M)]), np.eye(M + 1)[M], rcond=None)[0]
    x = [np.outer(points[0], h / (h @ h)) for _ in modes]
    P = [model.initial_covariance(D) for _ in modes]
    steps = functools.cache(
        lambda dt: [(mode.transition(dt)[0], mode.process_noise(dt)[0]) for mode in modes]
    )
    out = [0.0]
    i = 1
    for t in range(frames[0] + 1, frames[-1] + 1):
        prior = w @ T
        new_x, new_P = [], []
        for b in range(M):
            share = w * T[:, b] / prior[b]
            mean = sum(share[a] * x[a] for a in range(M))
            spread = sum(share[a] * (P[a] + (x[a] - mean).T @ (x[a] - mean) / D) for a in range(M))
            F, Q = steps(times[t] - times[t - 1])[b]
            new_x.append(mean @ F.T)
            new_P.append(F @ spread @ F.T + Q)
        x, P, w = new_x, new_P, prior
        if frames[i] != t:
            continue
        logs = np.empty(M)
        for b in range(M):
            S = h @ P[b] @ h + r
            e = points[i] - x[b] @ h
            logs[b] = -0.5 * e @ e / S - (D / 2) * np.log(2 * np.pi * S)
            K = P[b] @ h / S
            x[b] = x[b] + np.outer(e, K)
            P[b] = P[b] - np.outer(K, K) * S
        w = w * np.exp(logs - logs.max())  # far detections have no likelihood in double precision
        out.append(math.log(w.sum()) + logs.max())
        w /= w.sum()
        i += 1
    return np.array(out)
