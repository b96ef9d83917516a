"""Metrics for Prometheus."""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

from hexwrap_server import __version__
from hexwrap_server.jobs.store import Job

MEDIA_TYPE = "text/plain; version=0.0.4; charset=utf-8"
_SECONDS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)


class Metrics:
    """One registry per application."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        r = self.registry
        Gauge("hexwrap_info", "Version", ["version"], registry=r).labels(__version__).set(1)
        self.queued = Gauge("hexwrap_works_queued", "Works that wait", registry=r)
        self.running = Gauge("hexwrap_works_running", "Works that run", registry=r)
        self.jobs = Counter("hexwrap_jobs", "Jobs by how they ended", ["status"], registry=r)
        self.stages = Histogram(
            "hexwrap_stage_seconds", "Seconds per stage", ["stage", "found"], buckets=_SECONDS, registry=r
        )
        self.requests = Counter(
            "hexwrap_http_requests", "Answers by route and status", ["method", "route", "status"], registry=r
        )
        self.latency = Histogram(
            "hexwrap_http_seconds", "Seconds until an answer", ["route"], buckets=_SECONDS, registry=r
        )

    def ended(self, job: Job) -> None:
        self.jobs.labels(job.status).inc()
        for stage, seconds in job.timings.items():
            self.stages.labels(stage, job.found.get(stage, "computed")).observe(seconds)

    def text(self) -> bytes:
        return generate_latest(self.registry)
