"""The simulated world: throws, recorded flights, scene, hand contact, physics, pictures."""
