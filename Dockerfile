# Image of the program without the viewer: docker build -t tautline .
FROM rust:1-bookworm AS build
WORKDIR /tautline
COPY . .
RUN cargo build --release --locked --package tautline --no-default-features

FROM debian:bookworm-slim
COPY --from=build /tautline/target/release/tautline /usr/local/bin/tautline
WORKDIR /data
ENTRYPOINT ["tautline"]
