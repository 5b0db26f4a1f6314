"""The long-lived parts of a cluster of several machines: its scheduler, and workers."""

import asyncio
import signal
import socket
from pathlib import Path

from shapeshift.app.cluster.certificates import read_certificates
from shapeshift.app.cluster.dask_cluster import node_options, quiet_dask, reason, worker_options
from shapeshift.app.cluster.open_cluster import Address
from shapeshift.app.errors import UsageError
from shapeshift.app.terminal import say


def serve_scheduler(address: Address, certificates: Path | None) -> None:
    """Until Ctrl-C.  Raises UsageError where the address cannot be listened on."""
    from distributed import Scheduler

    security = security_of(address, certificates)

    async def serve() -> None:
        options = node_options(address.host, security) | {"port": address.port}
        try:
            scheduler = await Scheduler(**options)
        except (OSError, RuntimeError) as error:
            raise UsageError(f"{address.text} cannot be listened on ({reason(error)}).") from None
        async with scheduler:
            say(f"scheduler at {address.text}; Ctrl-C ends it.")
            await asked_to_end(scheduler.finished())

    with quiet_dask():
        asyncio.run(serve())


def serve_workers(
    address: Address, certificates: Path | None, host: str, count: int, gpus: int
) -> None:
    """So many on this machine, until Ctrl-C or the scheduler's end.

    host: where they listen; "": where this machine reaches the scheduler from.
    """
    from distributed import Nanny

    security = security_of(address, certificates)
    host = host or own_host(address)

    async def serve(folder: Path) -> None:
        node = node_options(host, security)
        made = [
            Nanny(address.text, **node, **worker_options(i, count, gpus, folder))
            for i in range(count)
        ]
        try:
            await asyncio.wait_for(asyncio.gather(*made), 30)
        except (OSError, RuntimeError, TimeoutError) as error:
            await close(made)
            raise UsageError(f"no scheduler answers at {address.text} ({reason(error)}).") from None
        say(f"{count} worker{'s' * (count > 1)} of {address.text}, listening on {host}; Ctrl-C "
            "ends them.")  # fmt: skip
        try:
            await asked_to_end(asyncio.gather(*(nanny.finished() for nanny in made)))
        finally:
            await close(made)

    with quiet_dask() as folder:
        asyncio.run(serve(folder))


async def close(nannies: list) -> None:
    await asyncio.gather(*(nanny.close() for nanny in nannies), return_exceptions=True)


async def asked_to_end(finished) -> None:
    """Returns at its end, or after SIGTERM; Ctrl-C cancels what waits."""
    asked, loop = asyncio.Event(), asyncio.get_running_loop()
    try:
        loop.add_signal_handler(signal.SIGTERM, asked.set)
    except NotImplementedError:
        pass  # Windows has none
    waits = [asyncio.ensure_future(each) for each in (finished, asked.wait())]
    try:
        await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for wait in waits:
            wait.cancel()


def security_of(address: Address, certificates: Path | None):
    return read_certificates(certificates, address.text) if address.protocol == "tls" else None


def own_host(address: Address) -> str:
    """The address of this machine that faces the scheduler.  Raises UsageError."""
    try:
        rows = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)
        family, kind, protocol, _, where = rows[0]
        with socket.socket(family, kind, protocol) as facing:
            facing.connect(where)  # of a datagram socket: nothing is sent
            return facing.getsockname()[0]
    except OSError as error:
        why = error.strerror or error
        raise UsageError(f"{address.text}: this machine finds no way there ({why}).") from None
