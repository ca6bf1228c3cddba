"""Orbit and attitude messages: CCSDS OEM and AEM, two-line elements. They contain states, not flights."""
