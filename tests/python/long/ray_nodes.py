# SPDX-License-Identifier: MIT
"""A Ray cluster of local nodes, for search_cluster_test.py; run under build/venv-ray. Says its address on the first
line, then does what it reads: `kill` takes the second node away without a warning, `stop` ends it."""

import sys

import ray.cluster_utils


def main():
    memory = {"object_store_memory": 100 * 2**20}
    cluster = ray.cluster_utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False, **memory})
    cluster.add_node(num_cpus=1, **memory)
    second = cluster.add_node(num_cpus=2, **memory)
    try:
        cluster.wait_for_nodes()
        print(cluster.address, flush=True)
        for line in sys.stdin:
            if line.strip() == "kill":
                cluster.remove_node(second, allow_graceful=False)
                print("killed", flush=True)
            elif line.strip() == "stop":
                break
    finally:
        cluster.shutdown()


if __name__ == "__main__":
    main()
