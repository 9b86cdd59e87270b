"""Other trackers, each behind one function: detections and a setting in, labels out.

A new one is a file with a `Peer` and a line here.
"""

from __future__ import annotations

from peers import (
    btrack_bayes,
    laptrack_lap,
    motpy_boxes,
    norfair_points,
    nrl_gnn,
    numpy_loop,
    stone_soup,
    trackpy_link,
)
from peers.peer import Peer, Setting, in_frames

__all__ = ["PEERS", "Peer", "Setting", "in_frames"]

PEERS: dict[str, Peer] = {
    peer.name: peer
    for peer in (
        stone_soup.GNN,
        stone_soup.JPDA,
        trackpy_link.PEER,
        laptrack_lap.PEER,
        btrack_bayes.PEER,
        motpy_boxes.PEER,
        norfair_points.PEER,
        nrl_gnn.PEER,
        numpy_loop.PEER,
    )
}
"""Peer by name; Stone Soup first, against which times are given."""
