# Image of the program without the viewer: docker build -t tautline .
FROM rust:1.95.0-trixie AS build
WORKDIR /tautline
COPY . .
RUN cargo build --release --locked --package tautline --no-default-features

FROM debian:13.6-slim
COPY --from=build /tautline/target/release/tautline /usr/local/bin/tautline
# Every user may write here: a mounted folder needs `docker run --user "$(id -u):$(id -g)"`.
RUN install --directory --mode=1777 /data
USER 1000:1000
WORKDIR /data
ENTRYPOINT ["tautline"]
