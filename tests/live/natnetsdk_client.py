"""OptiTrack's Python client as a process: it notes the frames, and prints the number of each."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import time

import numpy as np
from natnetsdk.NatNetClient import NatNetClient


def main(port, out, n):
    client, frames = NatNetClient(), []
    client.command_port, client.print_level = port, 0
    client.set_use_multicast(False)
    unpack = client._NatNetClient__unpack_mocap_data

    def noted(*args):
        at, frame = unpack(*args)
        frames.append(frame)
        print(frame.prefix_data.frame_number, file=sys.__stdout__, flush=True)
        return at, frame

    client._NatNetClient__unpack_mocap_data = noted
    with contextlib.redirect_stdout(io.StringIO()):
        client.run()
        while client.get_nat_net_requested_version()[0] == 0:
            time.sleep(0.01)
        version = client.get_nat_net_requested_version()
        print(f"{version[0]}.{version[1]}", file=sys.__stdout__, flush=True)
        end = time.monotonic() + 60
        while len(frames) < n and time.monotonic() < end:
            time.sleep(0.01)
    sets = [f.marker_set_data.marker_data_list[0].marker_pos_list for f in frames]
    np.savez(
        out,
        markers=np.array(sets, np.float32),
        others=np.array([f.legacy_other_markers.marker_pos_list for f in frames], np.float32),
        times=[f.suffix_data.timestamp for f in frames],
    )
    os._exit(0 if len(frames) == n else 1)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
