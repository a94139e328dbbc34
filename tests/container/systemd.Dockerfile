# A machine with systemd as its first process, and our services installed as docs/companion.md says.
ARG BASE
FROM swarmtouch AS ours

FROM ${BASE}
RUN apt-get update && apt-get install --yes --no-install-recommends systemd dbus
COPY --from=ours /opt/swarmtouch /opt/swarmtouch
COPY systemd /etc/systemd/system
COPY systemd/swarmtouch.env /etc/swarmtouch/swarmtouch.env
RUN echo 'SWARMTOUCH_CONSOLE_TOKEN="a token of this test"' > /etc/swarmtouch/console.env && chmod 600 /etc/swarmtouch/console.env
COPY scenarios/rhombus.toml /etc/swarmtouch/scenario.toml
CMD ["/lib/systemd/systemd"]
