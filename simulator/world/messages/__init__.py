"""Orbit and attitude files of others: CCSDS OEM and AEM, two-line elements. They know states, not flights."""
