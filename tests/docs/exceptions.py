"""Exceptions of the tests of the docs, each with its reason. A page that needs a further exception adds a line here."""

from __future__ import annotations

# Programs other than tautline that the tests run.
RUN = {"cat", "cp"}

# Beginnings of further commands that the tests run.
RUN_ALSO = ("python3 check_proof.py",)

# Programs that the tests do not run. Calls of tautline in their arguments are checked all the same.
NOT_RUN = {
    "cargo": "builds; its targets are looked for in the tree",
    "cd": "changes to the shared folder of a cluster",
    "export": "a setting of the reader's shell",
    "gh": "downloads a release",
    "git": "shows the reader's changes, or copies another project",
    "pip": "tests/setup.sh installs what the tests need",
    "python": "runs the driver of a cluster or benchmarks; tests/cluster and tests/ci run them",
    "python3": "runs these tests, or a script of RUN_ALSO",
    "ray": "starts a cluster; tests/cluster starts one",
    "sbatch": "submits to Slurm; tests/cluster does",
    "sh": "sets up and runs all tests, or changes the sources",
    "ssh": "runs on another machine",
}

# (page, beginning of the command): reason not to run it.
NOT_RUN_HERE = {
    ("CONTRIBUTING.md", "cargo run --release -- schema"): "writes docs/scenario.md; test_book.py compares the two",
    ("docs/clusters.md", "cp target/release/tautline"): "copies into the shared folder of a cluster",
    ("docs/clusters.md", "/shared/tautline"): "the same",
    ("docs/export.md", "tautline watch mavlink:"): "listens until Ctrl-C",
    ("docs/watch.md", "tautline watch mavlink:"): "listens until Ctrl-C; crates/watch tests the source",
    ("docs/watch.md", "tautline watch rosbridge:"): "the same; tests/program/watch.rs runs it",
    ("docs/planners.md", "tautline watch rosbridge:"): "the same; crates/watch tests the source",
    ("docs/watch.md", "tautline watch foxglove:"): "the same",
    ("docs/benchmarks.md", "tautline run"): "ten thousand and a hundred thousand vehicles: minutes, 0.4 GB of memory",
}

# (page, beginning of the command): reason for a duration of more than 20 s. Runs with TAUTLINE_LONG, else is parsed.
LONG = {
    ("README.md", "tautline campaign run examples/campaign.toml"): "a thousand flights",
    ("docs/studies.md", "tautline attack pentagon"): "a thousand flights",
    ("docs/campaigns.md", "tautline campaign run examples/campaign.toml"): "a thousand flights",
    ("docs/campaigns.md", "tautline campaign replay out/campaign"): "of the campaign above",
    ("docs/campaigns.md", "tautline campaign shard"): "a thousand flights",
    ("docs/campaigns.md", "tautline campaign missing"): "of the shards above",
    ("docs/campaigns.md", "tautline campaign merge"): "of the shards above",
    ("docs/shield.md", "tautline check shielded-crazyflies --set vehicle.model=hummingbird"): "a thousand flights",
    ("docs/studies.md", "tautline compare"): "sixty flights",
    ("docs/viewer.md", "tautline render out/pentagon/run.mcap --film"): "six hundred pictures",
    ("docs/viewer.md", "tautline render pentagon-laplacian"): "two hundred pictures",
}

# Built programs that run in place of cargo.
INSTEAD = {
    "cargo run --release --example own_law": "debug/examples/own_law",
    "cargo run --release --package example-shield": "debug/example-shield",
}
