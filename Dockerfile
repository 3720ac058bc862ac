# Three images from one file: `robot` (bridge and simulated robot), `console` (the service and its page), and `proxy`
# (TLS). All run as a user of their own. The images below it can be given by digest, as docker-compose.yml does.

ARG NODE_IMAGE=node:24-bookworm-slim
ARG PYTHON_IMAGE=python:3.11-slim-bookworm
ARG CADDY_IMAGE=caddy:2.10-alpine

FROM ${NODE_IMAGE} AS page
WORKDIR /src/web
COPY web/package.json web/package-lock.json ./
RUN npm ci --no-audit --no-fund
COPY web ./
RUN npm run build

FROM ${PYTHON_IMAGE} AS base
ENV PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
WORKDIR /src
COPY requirements.lock ./
RUN pip install --no-deps --require-hashes -r requirements.lock
COPY LICENSE NOTICE ./
COPY protocol ./protocol
COPY robot_bridge ./robot_bridge
# A new volume takes over the owner of the folder that it covers.
RUN useradd --system --create-home --uid 10001 lockstep \
    && install -d -o lockstep -g lockstep -m 0755 /run/lockstep /run/lockstep/link /run/lockstep/turn \
    && install -d -o lockstep -g lockstep -m 0700 /var/lib/lockstep

FROM base AS robot
RUN apt-get update \
    && apt-get install -y --no-install-recommends libegl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/*
RUN pip install --no-build-isolation --no-deps ./protocol ./robot_bridge
USER lockstep
WORKDIR /home/lockstep
EXPOSE 5600
ENTRYPOINT ["lockstep", "robot"]
CMD ["mobile-manipulator", "--host", "0.0.0.0", "--port", "5600"]

FROM base AS console
COPY rtc ./rtc
COPY server ./server
COPY --from=page /src/server/lockstep/server/web_dist ./server/lockstep/server/web_dist
RUN pip install --no-build-isolation --no-deps ./protocol ./rtc ./robot_bridge ./server
USER lockstep
WORKDIR /home/lockstep
EXPOSE 8000
# The robot and all else are settings: of variables, of a file that LOCKSTEP_CONFIG names, or of flags.
ENTRYPOINT ["lockstep", "serve"]

FROM ${CADDY_IMAGE} AS proxy
RUN adduser -D -H -u 10001 lockstep && chown -R lockstep /data /config
COPY deploy/Caddyfile /etc/caddy/Caddyfile
USER lockstep
