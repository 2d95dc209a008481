"""What the tests of the docs do not run, run late, or look at otherwise, each with its reason. Whoever writes a page that needs
another exception adds a line here."""

from __future__ import annotations

# Programs beside tautline that a page may call and that are run.
RUN = {"cat", "cp"}

# Programs that are not run. What they say to tautline is parsed all the same.
NOT_RUN = {
    "cargo": "builds; its targets are looked for in the tree",
    "cd": "to a folder that a cluster shares",
    "export": "a setting of the reader's shell",
    "git": "looks at the reader's changes",
    "pip": "tests/setup.sh installs what the tests need",
    "python": "runs the driver of a cluster; tests/cluster runs it",
    "python3": "runs these tests",
    "ray": "starts a cluster; tests/cluster starts one",
    "sbatch": "submits to Slurm; tests/cluster does",
    "sh": "sets up and runs all tests, or changes the sources",
    "ssh": "goes to another machine",
}

# (page, beginning of the command): why it is not run.
NOT_RUN_HERE = {
    ("CONTRIBUTING.md", "cargo run --release -- schema"): "writes docs/scenario.md; test_book.py compares the two",
    ("docs/clusters.md", "cp target/release/tautline"): "into a folder that a cluster shares; tests/cluster flies from one",
    ("docs/clusters.md", "/shared/tautline"): "the same",
    ("docs/scale.md", "tautline run"): "ten thousand and a hundred thousand vehicles: minutes, and 0.4 GB of memory",
}

# (page, beginning of the command): what takes more than some 20 s in a debug build. Run with TAUTLINE_LONG, else parsed.
LONG = {
    ("README.md", "tautline margin crazyflies"): "quadrotors, eleven flights and more",
    ("README.md", "tautline compare"): "sixty flights",
    ("docs/attack.md", "tautline attack pentagon"): "a thousand flights",
    ("docs/campaigns.md", "tautline campaign run examples/campaign.toml"): "a thousand flights",
    ("docs/campaigns.md", "tautline campaign replay out/campaign"): "of the campaign above",
    ("docs/campaigns.md", "tautline campaign shard"): "a thousand flights",
    ("docs/campaigns.md", "tautline campaign missing"): "of the shards above",
    ("docs/campaigns.md", "tautline campaign merge"): "of the shards above",
    ("docs/compare.md", "tautline compare"): "sixty flights",
    ("docs/viewer.md", "tautline render out/pentagon/run.mcap --film"): "six hundred pictures",
}

# What cargo would build is built when the tests run: these run instead of it.
INSTEAD = {
    "cargo run --release --example own_law": "debug/examples/own_law",
}

# Pages with a block of text below a command that is not what the command prints, by how the block begins.
OTHER_OUTPUT = {
    ("docs/audit.md", "PROVED CLEAR: never closer than 0.305304 m"): "an example of the answer, of a recording with curves",
}

# Parts of scenarios stand alone on a page: this is what else must be set for the program to take them, over `pentagon`.
AROUND = {
    "docs/safety.md": ["swarm.hull_radius_m=0.1", "law={kind=\"displacement\", delta_m=0.25}", "swarm.dimensions=3"],
}
