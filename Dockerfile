# SPDX-License-Identifier: MIT
# docker build -t stemvo . && docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/work" stemvo run RECORDING --out result
FROM debian:12 AS build
RUN apt-get update && apt-get install -y --no-install-recommends git make
WORKDIR /stemvo
COPY . .
RUN make build && cd build/release && cpack -G DEB

FROM debian:12
COPY --from=build /stemvo/build/release/stemvo_*.deb /tmp/
RUN apt-get update && apt-get install -y --no-install-recommends /tmp/stemvo_*.deb && rm -rf /tmp/*.deb /var/lib/apt/lists/*
RUN useradd --create-home stemvo
USER stemvo
WORKDIR /work
ENTRYPOINT ["stemvo"]
