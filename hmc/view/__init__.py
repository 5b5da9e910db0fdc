"""Pictures and videos of results; ``hmc.view(people, recording, out)`` writes one (`hmc.api.view`)."""

from hmc.callable_package import make_callable

make_callable(__name__)
