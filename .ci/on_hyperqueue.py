"""Parts of a flank command on HyperQueue: program, folder, number of parts, command. The process of one part is killed in the middle, and
failed parts are submitted again."""

import subprocess, sys, threading, time
from pathlib import Path

from hyperqueue import Job
from hyperqueue.cluster import LocalCluster, WorkerConfig

flank, folder, parts, words = sys.argv[1], Path(sys.argv[2]).absolute(), int(sys.argv[3]), sys.argv[4].split()


def kill():
    """Kills the process of the first part that has begun."""
    while not any(folder.glob("part-*/*.rows")) and not any(folder.glob("part-*/*.journal")):
        time.sleep(0.005)
    subprocess.run(["pkill", "-KILL", "-o", "-f", "--", "--part .*/16 --resume"])


def submit(client, wanted):
    job = Job()
    for i in wanted:
        out = ["--out", str(folder / f"part-{i}")]
        job.program([flank, *words, "--part", f"{i}/{parts}", "--resume", "--quiet", "--threads", "1", *out], name=f"part {i}")
    submitted = client.submit(job)
    client.wait_for_jobs([submitted], raise_on_error=False)
    return [wanted[task] for task in client.get_failed_tasks(submitted)]


if __name__ == "__main__":
    with LocalCluster() as cluster:
        cluster.start_worker(WorkerConfig(cores=2))
        threading.Thread(target=kill, daemon=True).start()
        wanted = list(range(parts))
        for _ in range(3):
            wanted = submit(cluster.client(), wanted)
            if not wanted:
                break
        else:
            sys.exit(f"parts {wanted} failed three times")
