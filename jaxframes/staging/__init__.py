"""How programs are handed to XLA: the only folder that names parts of JAX that may change with its next release."""

from jaxframes.staging import taylor

taylor.register()
