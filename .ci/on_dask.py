"""Parts of a flank command on Dask: program, folder, number of parts, command. The worker of one part is killed in the middle."""

import os, signal, subprocess, sys, threading, time
from pathlib import Path

from dask.distributed import Client, LocalCluster

flank, folder, parts, words = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), sys.argv[4].split()


def part(i):
    out = folder / f"part-{i}"
    done = subprocess.run([flank, *words, "--part", f"{i}/{parts}", "--resume", "--quiet", "--threads", "1", "--out", str(out)])
    if done.returncode not in (0, 3):
        raise RuntimeError(f"part {i} ended with {done.returncode}")
    return os.getpid()


def kill():
    """Kills the worker of the first part that has begun, and its process."""
    while not any(folder.glob("part-*/*.rows")) and not any(folder.glob("part-*/*.journal")):
        time.sleep(0.005)
    worker = cluster.workers[0].pid
    subprocess.run(["pkill", "-KILL", "-P", str(worker)])
    os.kill(worker, signal.SIGKILL)


if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster, Client(cluster) as client:
        threading.Thread(target=kill, daemon=True).start()
        client.gather(client.map(part, range(parts), retries=3))
